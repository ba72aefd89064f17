"""Runs for other programs, in their own types."""

import numpy as np

from .reader import Run


def observables_frame(run: Run):
    """The observables as a pandas DataFrame (needs the package pandas), a row per sample.

    The index is the time, the columns are called like the observables: `all/kinetic_energy`; of
    those with several numbers `momentum_x`, `wall_collisions_left`, `virial_tensor_xy`, and so on.
    """
    import pandas

    columns = {}
    for name in run.observables:
        time, value = run.observable(name)
        parts = {(): ("",), (2,): ("_x", "_y"), (4,): ("_left", "_right", "_bottom", "_top")}
        values = value.reshape(len(time), -1).T
        if name == "virial_tensor":
            parts[4,] = ("_xx", "_xy", "_yx", "_yy")
        columns |= zip([name + part for part in parts[value.shape[1:]]], values, strict=True)
    return pandas.DataFrame(columns, index=pandas.Index(time, name="time"))


def mdanalysis_universe(run: Run):
    """The run as an MDAnalysis Universe (needs the package MDAnalysis).

    MDAnalysis has three dimensions only: z = 0 is added.  Lengths and times keep their
    numbers; the time between frames is their mean.  Selections go by species, such as
    `u.select_atoms("type projectile")`; the analysis classes work on `u.trajectory`.
    """
    import MDAnalysis

    universe = MDAnalysis.Universe.empty(run.count, trajectory=True, velocities=True)
    flat = [np.pad(a[:], ((0, 0), (0, 0), (0, 1))) for a in (run.position, run.velocity)]
    step = (run.time[-1] - run.time[0]) / (run.frames - 1) if run.frames > 1 else 1.0
    universe.load_new(flat[0], velocities=flat[1], order="fac", dt=step)
    universe.add_TopologyAttr("masses", run.mass)
    universe.add_TopologyAttr("radii", run.radius)
    universe.add_TopologyAttr("types", [run.names[s - 1] for s in run.species])
    return universe
