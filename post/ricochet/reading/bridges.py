"""Conversion of runs to data types of other packages.

Conversion for pandas and xarray is implemented by `Run.to_dataframe` and `Run.to_xarray`.
"""

from typing import TYPE_CHECKING

import numpy as np

from .reader import Run

if TYPE_CHECKING:
    import MDAnalysis


def mdanalysis_universe(run: Run) -> "MDAnalysis.Universe":
    """Convert a run to a `Universe` of the package MDAnalysis, which must be installed.

    Because MDAnalysis requires three dimensions, all disks have z = 0. Lengths and times are stored
    without conversion of units.  MDAnalysis assumes equally spaced frames; the time between frames
    is set to the mean interval. The type of an atom is the name of the species, as in
    `u.select_atoms("type projectile")`.  All analysis classes of MDAnalysis can use `u.trajectory`.

    Parameters
    ----------
    run : Run
        a run

    Returns
    -------
    MDAnalysis.Universe
        all frames, in memory

    Examples
    --------
    >>> universe = ricochet.mdanalysis_universe(run) if has_mdanalysis else None
    >>> universe is None or len(universe.trajectory) == run.n_frames
    True
    """
    import MDAnalysis

    universe = MDAnalysis.Universe.empty(run.n_disks, trajectory=True, velocities=True)
    flat = [np.pad(a[:], ((0, 0), (0, 0), (0, 1))) for a in (run.position, run.velocity)]
    step = (run.time[-1] - run.time[0]) / (run.n_frames - 1) if run.n_frames > 1 else 1.0
    universe.load_new(flat[0], velocities=flat[1], order="fac", dt=step)
    universe.add_TopologyAttr("masses", run.mass)
    universe.add_TopologyAttr("radii", run.radius)
    universe.add_TopologyAttr("types", [run.names[s - 1] for s in run.species])
    return universe
