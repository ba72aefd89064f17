"""Contact networks and force chains from the event log of a run.

In an event-driven simulation the mean force between two disks during a time window is the sum of
the impulses they exchange in collisions, divided by the length of the window.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from .files import RunError, optional_package
from .reader import Run

if TYPE_CHECKING:
    import pandas

__all__ = ["ContactNetwork", "chains", "network"]


class ContactNetwork(NamedTuple):
    """Contacts between disks, and of disks with boundaries, from the collisions in a time window.

    All arrays have one row for each of the E contacts. As in `EventLog`, a positive `j` is the id
    of another disk (larger than `i`); 0, -1, -2, ... are boundary ids.
    """

    i: np.ndarray  # (E,) id of the first disk, counted from 1
    j: np.ndarray  # (E,)
    contacts: np.ndarray  # (E,) number of collisions
    impulse: np.ndarray  # (E,) sum of the magnitudes of all momentum changes
    momentum: np.ndarray  # (E, 2) sum of the momentum changes of disk i
    start: float  # of the window, itself excluded
    end: float  # of the window, itself included

    @property
    def force(self) -> np.ndarray:
        """Mean force (E,) of each contact: its impulse divided by the length of the window."""
        return self.impulse / (self.end - self.start)

    @property
    def pairs(self) -> np.ndarray:
        """Mask (E,) that is True for contacts between disks, False for contacts with boundaries."""
        return self.j > 0

    def matrix(self, n_disks: int, quantity: str = "impulse") -> "scipy.sparse.csr_array":
        """Return a quantity of the contacts between disks as a symmetric sparse matrix.

        Parameters
        ----------
        n_disks : int
            number N of disks in the run
        quantity : {"impulse", "contacts", "force"}
            quantity to return

        Returns
        -------
        scipy.sparse.csr_array
            (N, N) matrix, where row k belongs to the disk with the id k + 1

        Examples
        --------
        >>> found = contacts.network(run)
        >>> matrix = found.matrix(run.n_disks, "contacts")
        >>> bool(matrix.sum() == 2 * run.observable("collisions").value[-1])
        True
        """
        pairs, values = self.pairs, np.asarray(getattr(self, quantity))
        ends = (self.i[pairs] - 1, self.j[pairs] - 1)
        half = scipy.sparse.coo_array((values[pairs], ends), shape=(n_disks, n_disks))
        return (half + half.T).tocsr()

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return the contacts as a pandas DataFrame.

        Returns
        -------
        pandas.DataFrame
            (E, 7) columns i, j, contacts, impulse, force, momentum_x, momentum_y

        Raises
        ------
        ImportError
            if pandas is not installed

        Examples
        --------
        >>> table = contacts.network(run, 0.0, 0.1).to_dataframe() if has_pandas else None
        >>> table is None or bool(np.all(table.contacts > 0))
        True
        """
        pandas = optional_package("pandas", "to_dataframe")
        columns = {name: getattr(self, name) for name in ("i", "j", "contacts", "impulse", "force")}
        columns |= {"momentum_x": self.momentum[:, 0], "momentum_y": self.momentum[:, 1]}
        return pandas.DataFrame(columns)


def network(run: Run, start: float | None = None, end: float | None = None) -> ContactNetwork:
    """Return the contacts in the time window start < t <= end from the event log.

    Parameters
    ----------
    run : ricochet.Run
        a run with `output.event_log = .true.`
    start, end : float, optional
        ends of the time window [the whole run]

    Returns
    -------
    ContactNetwork
        one row for each pair of disks, or of disk and boundary, that collided in the window

    Raises
    ------
    RunError
        if the run has no event log, or does not cover the window

    Examples
    --------
    >>> found = contacts.network(run, 0.0, 0.1)
    >>> log = run.event_log()
    >>> bool(found.contacts.sum() == np.sum((log.time > 0) & (log.time <= 0.1)))
    True
    """
    log, last = run.event_log(), float(max(run.time[-1], run.observable("momentum").time[-1]))
    start, end = 0.0 if start is None else float(start), last if end is None else float(end)
    if not 0 <= start < end <= last * (1 + 1e-12):
        raise RunError(f"{run.path}: has no window from {start:g} to {end:g}; it ends at {last:g}")
    if log.momentum_change is None:
        raise RunError(f"{run.path}: its event log has no momentum_change; repeat the run")
    seen = slice(*np.searchsorted(log.time, (start, end), side="right"))
    ends = np.column_stack([log.i[seen], log.j[seen]]).astype(np.int64)
    rows, which, counts = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    which, size = which.ravel(), len(rows)
    impulse = np.bincount(which, log.impulse[seen], size)
    parts = [np.bincount(which, part, size) for part in np.transpose(log.momentum_change[seen])]
    return ContactNetwork(
        rows[:, 0], rows[:, 1], counts, impulse, np.column_stack(parts), start, end
    )


def chains(found: ContactNetwork, above: float = 1.0, at_least: int = 3) -> list[np.ndarray]:
    """Return the force chains: groups of disks connected by strong contacts.

    A contact is strong if its impulse exceeds `above` times the mean over all contacts between
    disks. Such contacts carry the deviatoric load of a granular medium (Radjai and others, Physical
    Review Letters 80, 61 (1998)).

    Parameters
    ----------
    found : ricochet.contacts.ContactNetwork
        contacts in a time window
    above : float
        threshold of a strong contact, relative to the mean impulse
    at_least : int
        fewest disks in a chain

    Returns
    -------
    list of numpy.ndarray
        for each chain, the largest first, the ids of its disks in increasing order

    Examples
    --------
    >>> found = contacts.network(run, 0.0, 0.1)
    >>> sizes = [len(chain) for chain in contacts.chains(found)]
    >>> sizes == sorted(sizes, reverse=True) and min(sizes) >= 3
    True
    """
    strong = strong_contacts(found, above)
    ids, ends = np.unique(np.array([found.i[strong], found.j[strong]]), return_inverse=True)
    edges = (np.ones(strong.sum()), tuple(ends.reshape(2, -1)))
    graph = scipy.sparse.coo_array(edges, shape=(len(ids), len(ids)))
    count, part = scipy.sparse.csgraph.connected_components(graph, directed=False)
    groups = [ids[part == k] for k in range(count)]
    return sorted((own for own in groups if len(own) >= at_least), key=len, reverse=True)


def strong_contacts(found: ContactNetwork, above: float = 1.0) -> np.ndarray:
    """Return a mask (E,) of the strong contacts between disks (see `chains`)."""
    pairs = found.pairs
    mean = found.impulse[pairs].mean() if pairs.any() else 0.0
    return pairs & (found.impulse > above * mean)
