"""Read and analyse the output files of Ricochet.

    from ricochet import read_run
    run = read_run("runs/gas.h5")

`reader` opens files; `statistics`, `theory`, `hard_disks`, `thermodynamics` and `crater` measure
and compare; `drawing` draws disks and walls; `script` is what the command-line scripts share.
"""

from .reader import Events, Obstacle, Run, RunError, Series, mdanalysis_universe, read_run

__all__ = ["Events", "Obstacle", "Run", "RunError", "Series", "mdanalysis_universe", "read_run"]
