"""Start Ricochet, read and analyse its output files.

    import ricochet
    run = ricochet.run("input/gas.nml")
    run = ricochet.read_run("runs/gas.h5")

`program` starts simulations, `simulation` has them in memory, `ensembles` makes many; `starting`
writes what they start from; `reader` opens files,
`bridges` hands them to other programs; `nature` says what kind of run one is, and so which laws
are for it; `statistics` finds means and errors, `theory` and `hard_disks` have the laws;
`thermodynamics`, `correlations`, `transport`, `structure`, `fields`, `speeds`, `cooling` and
`crater` measure;
`drawing` draws disks and walls, `film` moves them; `paths` knows where disks are between frames;
`live` shows a run that goes on, `lab` starts the runs of its pages; `script` is what the
command-line scripts share, `files` what opens files.
"""

from . import packages as packages  # first
from .bridges import mdanalysis_universe
from .ensembles import ensemble, sweep
from .program import ProgramError, run
from .reader import Events, Obstacle, Run, RunError, Series, read_run
from .simulation import Simulation
from .starting import write_start

__all__ = [
    "Events",
    "Obstacle",
    "ProgramError",
    "Run",
    "RunError",
    "Series",
    "Simulation",
    "ensemble",
    "mdanalysis_universe",
    "read_run",
    "run",
    "sweep",
    "write_start",
]
