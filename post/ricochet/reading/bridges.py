"""Conversion of runs to types of other packages; for pandas see `Run.to_dataframe`."""

from typing import TYPE_CHECKING

import numpy as np

from .reader import Run

if TYPE_CHECKING:
    import MDAnalysis


def mdanalysis_universe(run: Run) -> "MDAnalysis.Universe":
    """Return the run as a Universe of MDAnalysis, a package that must be installed.

    MDAnalysis supports three dimensions only: z = 0 is added.  Lengths and times are not converted;
    the time between frames is the mean interval.  Selections use the names of species, such as
    `u.select_atoms("type projectile")`; the analysis classes work on `u.trajectory`.

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
