"""Stream function psi of the mean flow of disks in a steady state.

In a steady state the flux j of disks (disks per length and time) has no divergence, so that j_x = d
psi / dy and j_y = -d psi / dx. Contour lines of psi are streamlines, and the difference of psi
between two points is the number of disks that pass between them per unit of time.

psi minimises the integral, over the box, of the squared difference between the measured flux and
the flux given by the derivatives of psi. In this integral the disks occur only in sums of their
velocities times the gradients of basis functions. The flux is therefore not averaged over cells,
and psi does not depend on the requested cells as long as the finite elements are small.
"""

from typing import NamedTuple

import numpy as np
import scipy

from ..reading.nature import Refused
from ..reading.reader import Run
from .estimates import Estimate, jackknife_of_sums
from .fields import (
    FLOW_LEAST,
    Cells,
    block_correlation,
    blocks_of,
    own_motion,
    places,
)

__all__ = ["StreamFunction", "stream_function"]

FINE = 64  # fewest finite elements along an axis


class StreamFunction(NamedTuple):
    """Stream function [1/time] at the corners and midpoints of C = NX NY cells."""

    corners: Estimate  # (NY + 1, NX + 1)
    middles: Estimate  # (C,) at the points returned by `fields.places`


class Mesh(NamedTuple):
    """Grid of bilinear finite elements covering the box of a run."""

    run: Run
    elements: tuple[int, int]  # along x and y

    @property
    def size(self) -> np.ndarray:
        """Lengths (2,) of the sides of an element."""
        return np.asarray(self.run.edges / self.elements)

    def corners_of(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the corners of the elements that contain points (P, 2), and their basis functions.

        The results are the nodes at the four corners (4, P), the values of their basis functions at
        the points (4, P), and the derivatives along x and y (4, 2, P).
        """
        place = (points - self.run.lower) / self.size
        cell = np.clip(place.astype(int), 0, np.array(self.elements) - 1)
        s, t = (place - cell).clip(0, 1).T
        width, height = self.size
        number = cell[:, 1] * (self.elements[0] + 1) + cell[:, 0]
        nodes = np.stack([number + a + b * (self.elements[0] + 1) for b in (0, 1) for a in (0, 1)])
        along_x, along_y = ((1 - s, s), (1 - t, t))
        values = np.stack([along_x[a] * along_y[b] for b in (0, 1) for a in (0, 1)])
        slopes = np.stack(
            [
                np.stack([(2 * a - 1) * along_y[b] / width, (2 * b - 1) * along_x[a] / height])
                for b in (0, 1)
                for a in (0, 1)
            ]
        )
        return nodes, values, slopes

    def loads(self, points: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the sums (nodes,) over disks of v_x d phi / dy - v_y d phi / dx.

        The disks have the positions `points` (P, 2) and the given velocities (P, 2); phi is the
        basis function of a node.
        """
        nodes, _, slopes = self.corners_of(points)
        parts = velocity[:, 0] * slopes[:, 1] - velocity[:, 1] * slopes[:, 0]
        total = (self.elements[0] + 1) * (self.elements[1] + 1)
        return np.bincount(nodes.ravel(), parts.ravel(), minlength=total)

    def stiffness(self) -> scipy.sparse.csr_array:
        """Return the integrals (nodes, nodes) of the products of gradients of basis functions."""
        parts = []
        for count, width in zip(self.elements, self.size, strict=True):
            ends = np.ones(count + 1)
            ends[[0, -1]] = 0.5
            beside = np.ones(count)
            mass = scipy.sparse.diags_array([beside, 4 * ends, beside], offsets=[-1, 0, 1])
            slope = scipy.sparse.diags_array([-beside, 2 * ends, -beside], offsets=[-1, 0, 1])
            parts.append((mass * (width / 6), slope / width))
        (mass_x, slope_x), (mass_y, slope_y) = parts
        whole = scipy.sparse.kron(mass_y, slope_x) + scipy.sparse.kron(slope_y, mass_x)
        return scipy.sparse.csr_array(whole)

    def solve(self, loads: np.ndarray) -> np.ndarray:
        """Return the stream functions (nodes, B) for B loads (nodes, B), with psi = 0 at node 0."""
        unknowns, nodes = node_unknowns(self.elements[1], self.elements[0], self.run.periodic)
        if not unknowns:
            return np.zeros(loads.shape)
        matrix = scipy.sparse.csc_array(nodes.T @ self.stiffness() @ nodes)
        psi = nodes @ scipy.sparse.linalg.splu(matrix).solve(nodes.T @ loads)
        return psi - psi[0]


def stream_function(
    runs: list[Run], skip: float | None, cells: Cells, species: str | None = None
) -> StreamFunction:
    """Measure the stream function of the flux of disks in a steady state.

    Parameters
    ----------
    runs : list of Run
        (R,) runs of one input that differ only in their seed
    skip : float, optional
        collisions per disk discarded as equilibration [the first half of each run]
    cells : tuple of int
        numbers of cells along x and y
    species : str, optional
        species whose flux is measured [all disks]

    Returns
    -------
    StreamFunction
        psi [1/time] at the corners and midpoints of the cells, with jackknife errors; psi is 0 in
        the lower left corner and constant on each wall

    Raises
    ------
    Refused
        if a run recycles disks, which adds sources to the flux

    Examples
    --------
    >>> psi = streams.stream_function(runs, None, (5, 4))
    >>> psi.corners.mean.shape, psi.middles.error.shape
    ((5, 6), (20,))
    """
    for run in runs:
        if "recycled" in run.nature:
            why = "recycles disks, so that their flux begins and ends inside the box"
            raise Refused(f"{run.path}: {why}: there is no stream function")
    blocks, most = blocks_of(runs, skip, cells)
    run = runs[0]
    finer = [-(-FINE // count) for count in cells]
    mesh = Mesh(run, (cells[0] * finer[0], cells[1] * finer[1]))
    own = run.species > 0 if species is None else run.of_species(species)
    loads = [
        mesh.loads(
            block.run.position[block.frames][:, own].reshape(-1, 2),
            velocities(block.run, block.frames)[:, own].reshape(-1, 2),
        )
        for block in blocks
    ]
    psi = mesh.solve(np.stack(loads, axis=1))
    shape = tuple(count + 1 for count in mesh.elements[::-1])
    corners = psi.reshape(*shape, -1)[:: finer[1], :: finer[0]]
    nodes, values, _ = mesh.corners_of(places(run, cells))
    middles = np.sum(values[..., None] * psi[nodes], axis=0)
    frames = np.array([[float(len(block.frames))] for block in blocks])
    sums = np.hstack([np.vstack([corners.reshape(-1, len(blocks)), middles]).T, frames])
    members = jackknife_of_sums(lambda total: total[:-1] / total[-1], sums, frames)
    by_field = members._replace(values=members.values[:, None], share=members.share[:, None])
    near = block_correlation(by_field, blocks, most, np.array([FLOW_LEAST]))
    found = members.estimate(near)
    edge = corners[..., 0].size
    return StreamFunction(
        Estimate(*(part[:edge].reshape(corners.shape[:2]) for part in found)),
        Estimate(*(part[edge:] for part in found)),
    )


def velocities(run: Run, frames: list[int]) -> np.ndarray:
    """Return velocities (F, N, 2), relative to the centre of mass only if noise accelerates it."""
    v = own_motion(run, frames)
    height = run.position[frames][..., 1] - run.lower[1] - run.edges[1] / 2
    v[..., 0] += run.shear_rate * height
    return v


def node_unknowns(
    rows: int, columns: int, periodic: np.ndarray
) -> tuple[int, scipy.sparse.csr_array]:
    """Return the number of unknowns, and the matrix that maps them to psi at the nodes.

    The unknowns are psi at the nodes not on walls, where periodic images share one unknown, and one
    flux for each periodic axis. Up to its sign, this flux is the difference of psi between the two
    sides parallel to the axis. On each wall psi is constant. It is 0 on the lower and the left wall
    or, without these walls, in the lower left corner.
    """
    y, x = np.meshgrid(np.arange(rows + 1), np.arange(columns + 1), indexing="ij")
    fixed = (x % columns == 0) & (y % rows == 0) if np.all(periodic) else np.zeros(x.shape, bool)
    if not periodic[0]:
        fixed |= (x == 0) | (x == columns)
    if not periodic[1]:
        fixed |= (y == 0) | (y == rows)
    home = (y % rows if periodic[1] else y) * (columns + 1) + (x % columns if periodic[0] else x)
    free, which = np.unique(home[~fixed], return_inverse=True)
    entries = [(np.flatnonzero(~fixed.ravel()), which, np.ones(len(which)))]
    unknowns = len(free)
    for axis, place, count in ((0, y, rows), (1, x, columns)):
        if periodic[axis]:  # flux along this axis
            every = np.arange(x.size)
            entries.append((every, np.full(x.size, unknowns), place.ravel() / count))
            unknowns += 1
    row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    return unknowns, scipy.sparse.csr_array((value, (row, column)), shape=(x.size, unknowns))
