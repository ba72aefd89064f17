"""Structure of a run: pair correlation, structure factor, clusters and bond order.

Libraries for structure analysis support periodic boxes but not walls. This module therefore uses
only SciPy.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import overload

import numpy as np
import scipy

from ..reading.arrays import Index, chosen
from ..reading.nature import TRAITS, allow
from ..reading.reader import Run
from .estimates import Curve, estimate
from .statistics import correlated_mean

__all__ = [
    "averaged",
    "bond_correlation",
    "bond_order",
    "evenly",
    "largest_cluster",
    "pair_correlation",
    "structure_factor",
]

MOST_PAIRS = 2 * 10**5  # largest number of pairs per frame in `bond_correlation`
MOST_TERMS = 3e8  # largest number of terms of S(k) per frame


def periods(run: Run) -> np.ndarray:
    """Return the displacements (M, 2) of the periodic images of the box, including 0."""
    along = [(-1, 0, 1) if periodic else (0,) for periodic in run.periodic]
    return run.edges * np.array([(i, j) for i in along[0] for j in along[1]])


def refuse(run: Run, *traits: str) -> None:
    """Raise Refused if the run has a property (`Run.nature`) other than the given ones."""
    law = "structure is found in boxes at rest" + ", S(k) in periodic ones" * ("walls" in traits)
    allow(run, law, *TRAITS.keys() - set(traits))


def pair_correlation(
    run: Run, frames: Index, edges: np.ndarray, pair: tuple[str, str] | None = None
) -> np.ndarray:
    """Return the pair correlation function g(r), averaged over frames.

    g(r) is the density at distance r from a disk, relative to the mean density of the box. Between
    walls, which may move, only disks far from the walls serve as centres.

    Parameters
    ----------
    run : ricochet.Run
        a run in a box at rest
    frames : ricochet.arrays.Index
        an integer, a slice or a list
    edges : numpy.ndarray
        (B + 1,) edges of the bins of r, in mean diameters
    pair : tuple of str, optional
        two species: density of the second around disks of the first [all disks]

    Returns
    -------
    numpy.ndarray
        (B,) g(r), or NaN if there are no pairs of disks

    Raises
    ------
    Refused
        if the box is sheared

    Examples
    --------
    >>> g = structure.pair_correlation(run, slice(10, None), np.linspace(0, 3, 31))
    >>> g.shape, bool(g[5] == 0), bool(g[10] > 1)
    ((30,), True, True)
    """
    refuse(run, "sheared")
    r = edges * 2 * run.radius.mean()
    size = np.where(run.periodic, run.edges, 0.0)
    one, *others = masks(run, pair)
    other = others[0] if others else one
    sums = np.zeros(len(edges) - 1)
    expected = 0.0  # pairs per area if disks were placed at random
    for k in chosen(run.n_frames, frames):
        x, (lower, upper) = run.position[k], run.corners_at(run.time[k])
        margin = np.where(run.periodic, -np.inf, r[-1])
        inner = one & np.all((x > lower + margin) & (x < upper - margin), axis=1)
        tree, part = (
            scipy.spatial.cKDTree(x[some] - run.lower * run.periodic, boxsize=size)
            for some in (other, inner)
        )
        sums += np.diff(part.count_neighbors(tree, r))
        expected += inner.sum() * (other.sum() - (not others)) / np.prod(upper - lower)
    return sums / (expected or np.nan) / (np.pi * np.diff(r**2))


def masks(run: Run, pair: tuple[str, str] | None) -> list[np.ndarray]:
    """Return the masks (N,) of the species in `pair`, or one mask of all disks."""
    return [run.of_species(name) for name in dict.fromkeys(pair)] if pair else [run.species > 0]


def structure_factor(
    run: Run, frames: Index, edges: np.ndarray, pair: tuple[str, str] | None = None
) -> np.ndarray:
    """Return the structure factor ``S(k) = <|sum of exp(i k x)|^2> / N``, averaged over frames.

    Since S(k) = S(-k), only one of k and -k is used. If there are many disks, the mean covers only
    some of the wave vectors.

    Parameters
    ----------
    run : ricochet.Run
        a run in a periodic box
    frames : ricochet.arrays.Index
        an integer, a slice or a list
    edges : numpy.ndarray
        (B + 1,) edges of the bins of k, in 1 / mean diameter
    pair : tuple of str, optional
        two species: the sums of both are multiplied, and N is the geometric mean of their numbers
        of disks [all disks]

    Returns
    -------
    numpy.ndarray
        (B,) S(k), or NaN in bins without a wave vector of the box

    Raises
    ------
    Refused
        if the box has walls or is sheared

    Examples
    --------
    >>> S = structure.structure_factor(run, slice(10, None), np.linspace(1, 11, 6))
    >>> S.shape, bool(np.all(S > 0))
    ((5,), True)
    """
    refuse(run, "sheared", "walls")
    unit = 2 * np.pi / run.edges  # wave vectors are integer multiples
    most = np.floor(edges[-1] / (2 * run.radius.mean()) / unit).astype(int)
    step = int(np.ceil(np.sqrt(2 * run.n_disks * np.prod(most + 1) / MOST_TERMS)))
    number_x, number_y = most // step
    along_x, along_y = step * np.arange(number_x + 1), step * np.arange(-number_y, number_y + 1)
    k = np.hypot(*np.meshgrid(along_x * unit[0], along_y * unit[1], indexing="ij"))
    k *= 2 * run.radius.mean()
    both = masks(run, pair)
    sums, numbers = np.zeros(k.shape), chosen(run.n_frames, frames)
    for frame in numbers:
        x, y = (run.position[frame] * unit * step).T
        waves = [sums_of_waves(x[some], y[some], number_x, number_y) for some in both]
        sums += (waves[0] * waves[-1].conj()).real
    sums /= np.sqrt(both[0].sum() * both[-1].sum()) * len(numbers)
    sums[(along_x[:, None] == 0) & (along_y <= 0)] = np.nan  # only one of k and -k
    known = np.isfinite(sums)
    total, _ = np.histogram(k[known], edges, weights=sums[known])
    number, _ = np.histogram(k[known], edges)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def sums_of_waves(x: np.ndarray, y: np.ndarray, most_x: int, most_y: int) -> np.ndarray:
    """Return sums of exp(i (m x + n y)) for m = 0 to `most_x` and n = -`most_y` to `most_y`."""
    parts = [
        np.ascontiguousarray(part)  # matrix products of strided arrays would be slow
        for phase, most in ((x, most_x), (y, most_y))
        for waves in [powers(phase, most)]
        for part in (waves.real, waves.imag)
    ]
    cos_x, sin_x, cos_y, sin_y = parts
    cc, ss = cos_x @ cos_y.T, sin_x @ sin_y.T
    sc, cs = sin_x @ cos_y.T, cos_x @ sin_y.T
    above, below = cc - ss + 1j * (sc + cs), cc + ss + 1j * (sc - cs)
    return np.concatenate([below[:, :0:-1], above], axis=1)


def powers(phase: np.ndarray, most: int) -> np.ndarray:
    """Return exp(i m phase) for m = 0 to `most`; products are faster than exponentials."""
    factors = np.ones((most + 1, len(phase)), dtype=complex)
    factors[1:] = np.exp(1j * phase)
    return np.cumprod(factors, axis=0)


def evenly(run: Run, frames: Index = slice(None), most: int = 50) -> list[int]:
    """Select frames at nearly equal intervals of time.

    Parameters
    ----------
    run : ricochet.Run
        any run
    frames : ricochet.arrays.Index
        frames from which to select
    most : int
        largest number of selected frames

    Returns
    -------
    list of int
        indices of the selected frames, in increasing order

    Examples
    --------
    >>> len(structure.evenly(run, most=5))
    5
    """
    which = np.array(chosen(run.n_frames, frames))
    time = run.time[which]
    at = np.interp(np.linspace(time[0], time[-1], most), time, np.arange(len(time)))
    return which[np.unique(at.round().astype(int))].tolist()


def averaged(
    of: Callable[..., np.ndarray],
    runs: Sequence[Run],
    frames: Sequence[Index],
    edges: np.ndarray,
    *more: object,
) -> Curve:
    """Average a function over runs, or over the frames of a single run.

    Parameters
    ----------
    of : callable
        function such as `pair_correlation`, which returns (B,) values for a run, frames, edges and
        `more`
    runs : sequence of Run
        (R,) runs that differ only in their seed
    frames : sequence of Index
        (R,) frames of each run
    edges : numpy.ndarray
        (B + 1,) edges of the bins
    *more : object
        further arguments of the function

    Returns
    -------
    Curve
        centres of the bins, means, and errors from the scatter of the runs or, for a single run,
        from the autocorrelation of its frames

    Examples
    --------
    >>> frames = [structure.evenly(one, most=10) for one in runs]
    >>> curve = averaged(pair_correlation, runs, frames, np.linspace(1, 3, 11))
    >>> len(curve.x), bool(np.all(curve.error > 0))
    (10, True)
    """
    middle, alone = (edges[1:] + edges[:-1]) / 2, len(runs) == 1
    parts: Iterable[tuple[Run, Index]] = zip(runs, frames, strict=True)
    if alone:
        parts = [(runs[0], [k]) for k in chosen(runs[0].n_frames, frames[0])]
    values = np.array([of(run, part, edges, *more) for run, part in parts])
    seen = np.isfinite(values).any(axis=1)  # there may be no pairs between walls close together
    known = np.isfinite(values[seen]).all(axis=0) & seen.any()
    columns = values[np.ix_(seen, known)]
    if not alone:
        return Curve(middle[known], *estimate(columns))
    each = [correlated_mean(one)[:2] for one in columns.T]
    return Curve(middle[known], *np.reshape(each, (-1, 2)).T)


@overload
def largest_cluster(run: Run, frame: int, gap: float) -> int: ...
@overload
def largest_cluster(run: Run, frame: Index, gap: float) -> int | np.ndarray: ...
def largest_cluster(run: Run, frame: Index, gap: float) -> int | np.ndarray:
    """Return the size of the largest cluster of disks connected by gaps smaller than `gap`.

    Parameters
    ----------
    run : ricochet.Run
        a run in a box at rest
    frame : ricochet.arrays.Index
        index of one frame, or of several
    gap : float
        largest gap between the rims of neighbours in a cluster [length]

    Returns
    -------
    int or numpy.ndarray
        number of disks in the cluster; (F,) for several frames

    Examples
    --------
    >>> structure.largest_cluster(run, -1, gap=1.0)
    64
    """
    refuse(run, "sheared")
    if not isinstance(frame, int | np.integer):
        each = chosen(run.n_frames, frame)
        return np.array([largest_cluster(run, k, gap) for k in each], dtype=int)
    x = np.clip(run.position[frame] - run.lower, 0, np.nextafter(run.edges, 0))
    tree = scipy.spatial.cKDTree(x, boxsize=np.where(run.periodic, run.edges, 0.0))
    i, j = tree.query_pairs(2 * float(run.radius.max()) + gap, output_type="ndarray").T
    apart = x[i] - x[j]
    apart -= np.where(run.periodic, run.edges * np.round(apart / run.edges), 0.0)
    near = np.hypot(*apart.T) < run.radius[i] + run.radius[j] + gap
    links = scipy.sparse.coo_array(
        (near[near], (i[near], j[near])), shape=(run.n_disks, run.n_disks)
    )
    _, cluster = scipy.sparse.csgraph.connected_components(links, directed=False)
    return int(np.bincount(cluster).max())


def bond_order(run: Run, frame: Index) -> np.ndarray:
    """Return the bond-orientational order psi6 of each disk, based on its Delaunay neighbours.

    Parameters
    ----------
    run : ricochet.Run
        any run
    frame : ricochet.arrays.Index
        index of one frame, or of several

    Returns
    -------
    numpy.ndarray
        (N,) or (F, N) complex numbers, with modulus 1 for six neighbours at equal angles

    Examples
    --------
    >>> psi6 = structure.bond_order(run, -1)
    >>> psi6.shape, bool(np.all(np.abs(psi6) <= 1 + 1e-12))
    ((64,), True)
    """
    if not isinstance(frame, int | np.integer):
        each = chosen(run.n_frames, frame)
        return np.array([bond_order(run, k) for k in each]).reshape(-1, run.n_disks)
    near = 4 * np.sqrt(np.prod(run.edges) / run.n_disks)
    points = run.position[frame]  # with periodic images near the box appended below
    for axis in np.flatnonzero(run.periodic):
        shift = np.where(np.arange(2) == axis, run.edges, 0.0)
        low = points[:, axis] < run.lower[axis] + near
        high = points[:, axis] > run.upper[axis] - near
        points = np.concatenate([points, points[low] + shift, points[high] - shift])
    start, neighbours = scipy.spatial.Delaunay(points).vertex_neighbor_vertices
    centre = np.repeat(np.arange(len(points)), np.diff(start))
    inside = centre < run.n_disks
    bonds = points[neighbours[inside]] - points[centre[inside]]
    turns = np.exp(6j * np.arctan2(bonds[:, 1], bonds[:, 0]))
    sums = np.bincount(centre[inside], turns.real, run.n_disks) + 1j * np.bincount(
        centre[inside], turns.imag, run.n_disks
    )
    return sums / np.bincount(centre[inside], minlength=run.n_disks)


def bond_correlation(
    run: Run, frames: Index, psi: Sequence[np.ndarray] | np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Return the correlation function of bond order, g6(r) = Re <psi6*(0) psi6(r)>.

    In large systems only some of the disks serve as centres.

    Parameters
    ----------
    run : ricochet.Run
        any run
    frames : ricochet.arrays.Index
        frames to use
    psi : sequence of numpy.ndarray
        (F, N) result of `bond_order` for these frames
    edges : numpy.ndarray
        (B + 1,) edges of the bins of r, in mean diameters

    Returns
    -------
    numpy.ndarray
        (B,) g6(r), or NaN in bins without pairs of disks

    Examples
    --------
    >>> psi6 = structure.bond_order(run, [-1])
    >>> structure.bond_correlation(run, [-1], psi6, np.linspace(1, 3, 5)).shape
    (4,)
    """
    few = np.linspace(0, run.n_disks - 1, min(run.n_disks, max(16, MOST_PAIRS // run.n_disks)))
    centres = few.astype(int)
    sums, pairs = np.zeros((2, len(edges) + 1))
    for frame, own in zip(chosen(run.n_frames, frames), psi, strict=True):
        x = run.position[frame]
        gap = x[centres, None] - x
        gap -= np.where(run.periodic, run.edges * np.round(gap / run.edges), 0.0)
        r = np.hypot(gap[..., 0], gap[..., 1]) / (2 * run.radius.mean())
        where = np.searchsorted(edges, r.ravel(), side="right")
        product = (own[centres, None].conj() * own).real.ravel()
        sums += np.bincount(where, product, len(sums))
        pairs += np.bincount(where, minlength=len(sums))
    return np.where(pairs > 0, sums / np.maximum(pairs, 1), np.nan)[1:-1]
