"""Stream function of a measured flow on a grid of cells.

In a steady state the flux of disks j = n u has no divergence.  Therefore a stream function psi
exists, with j_x = d psi / dy and j_y = -d psi / dx.  The contour lines of psi are the streamlines
of the mean flow.  The difference of psi between two streamlines is the number of disks that pass
between these streamlines per unit of time.
"""

import numpy as np
import scipy

from ..reading.reader import Run

__all__ = ["stream_function"]


def stream_function(run: Run, flux: np.ndarray) -> np.ndarray:
    """Fit a stream function to the flux of disks in cells.

    The fit minimises the sum of squared deviations between the measured flux and the flux that
    follows from the stream function.  The flux that follows from a stream function has no
    divergence, so that the fit removes the part of the noise that has a divergence.

    Parameters
    ----------
    run : ricochet.Run
        a run in the same box; no flux passes through the walls of the box
    flux : numpy.ndarray
        (2, NY, NX) density times flow along x and y [1/(length time)]; the value NaN, as in cells
        inside obstacles, is treated as 0

    Returns
    -------
    numpy.ndarray
        (NY + 1, NX + 1) stream function at the corners of the cells [1/time], which is 0 at the
        lower left corner

    Examples
    --------
    >>> still = np.zeros((2, 4, 5))
    >>> streams.stream_function(run, still).shape
    (5, 6)
    """
    _, rows, columns = flux.shape
    edges = run.edges / (columns, rows)
    unknowns, corners = corner_unknowns(rows, columns, run.periodic)
    # Each row of the matrix `corners` expresses psi at one corner as a sum of unknowns. The flux in
    # a cell is determined by differences of psi between the corners of the cell.
    number = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    lower, upper, left, right = number[:-1], number[1:], number[:, :-1], number[:, 1:]
    ends = slice(None, -1), slice(1, None)
    along_y = [(one[:, end], sign / 2) for one, sign in ((upper, 1), (lower, -1)) for end in ends]
    along_x = [(one[end], sign / 2) for one, sign in ((left, 1), (right, -1)) for end in ends]
    matrix = scipy.sparse.vstack(
        [
            differences(along_y, number.size) @ corners / edges[1],
            differences(along_x, number.size) @ corners / edges[0],
        ]
    )
    wanted = np.nan_to_num(flux).reshape(-1)
    if not unknowns or not wanted.any():
        return np.zeros(number.shape)
    fitted = scipy.sparse.linalg.lsqr(matrix, wanted, atol=1e-10, btol=1e-10, iter_lim=20000)[0]
    psi = (corners @ fitted).reshape(number.shape)
    return psi - psi[0, 0]


def differences(terms: list[tuple[np.ndarray, float]], count: int) -> scipy.sparse.csr_array:
    """Return a sparse matrix, whose rows are weighted sums of values at the corners of a cell."""
    cells = terms[0][0].size
    rows = np.tile(np.arange(cells), len(terms))
    columns = np.concatenate([corner.ravel() for corner, _ in terms])
    values = np.repeat([factor for _, factor in terms], cells)
    return scipy.sparse.csr_array((values, (rows, columns)), shape=(cells, count))


def corner_unknowns(
    rows: int, columns: int, periodic: np.ndarray
) -> tuple[int, scipy.sparse.csr_array]:
    """Return the number of unknowns, and the matrix that converts unknowns to psi at the corners.

    The unknowns of the fit are the values of psi at corners that are not on walls, followed by one
    flux for each periodic axis.  All periodic images of a corner share one unknown.  Psi is
    constant on each wall, and is 0 on the lower wall and on the left wall.  The flux along a
    periodic axis through the whole box is, except for its sign, the difference of psi between the
    two sides parallel to this axis.
    """
    y, x = np.meshgrid(np.arange(rows + 1), np.arange(columns + 1), indexing="ij")
    fixed = np.zeros(x.shape, dtype=bool)
    if not periodic[0]:
        fixed |= (x == 0) | (x == columns)
    if not periodic[1]:
        fixed |= (y == 0) | (y == rows)
    home = (y % rows if periodic[1] else y) * (columns + 1) + (x % columns if periodic[0] else x)
    free, which = np.unique(home[~fixed], return_inverse=True)
    entries = [(np.flatnonzero(~fixed.ravel()), which, np.ones(len(which)))]
    unknowns = len(free)
    for axis, place, count in ((0, y, rows), (1, x, columns)):
        if periodic[axis]:  # the flux along this axis
            every = np.arange(x.size)
            entries.append((every, np.full(x.size, unknowns), place.ravel() / count))
            unknowns += 1
    row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    return unknowns, scipy.sparse.csr_array((value, (row, column)), shape=(x.size, unknowns))
