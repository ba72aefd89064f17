"""Run Ricochet, read its output files, and analyse them.

    import ricochet
    run = ricochet.run("input/gas.nml")
    run = ricochet.read_run("runs/gas.h5")
    curve = ricochet.structure.pair_correlation(run)

The modules are in sub-packages (see `README.md` in this folder) and have short names: `from
ricochet import structure` imports `ricochet.analysis.structure`. A module is loaded when it is
first used, so that `import ricochet` alone loads neither Matplotlib nor a web server.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING

from . import packages as packages  # imported first, because it reports missing packages
from .aliases import Aliases
from .exchange.bridges import mdanalysis_universe
from .reading.files import RunError, did_you_mean
from .reading.frames import Frames, Series
from .reading.reader import Event, EventLog, Frame, Obstacle, Run, read_run
from .reports import analyse
from .reports import analyses as analyses  # not listed, because it is an object without a docstring
from .running.ensembles import ensemble, sweep
from .running.program import ProgramError, example, run
from .running.simulation import Simulation
from .running.starting import write_start

__version__ = "0.3.0"

__all__ = [
    "Event",
    "EventLog",
    "Frame",
    "Frames",
    "Obstacle",
    "ProgramError",
    "Run",
    "RunError",
    "Series",
    "Simulation",
    "analyse",
    "ensemble",
    "example",
    "mdanalysis_universe",
    "read_run",
    "run",
    "sweep",
    "write_start",
]

if TYPE_CHECKING:  # for type checkers only, because `__getattr__` loads these modules
    from .analysis import cooling as cooling
    from .analysis import correlations as correlations
    from .analysis import crater as crater
    from .analysis import driven as driven
    from .analysis import equilibrium as equilibrium
    from .analysis import estimates as estimates
    from .analysis import fields as fields
    from .analysis import speed_laws as speed_laws
    from .analysis import speeds as speeds
    from .analysis import statistics as statistics
    from .analysis import streams as streams
    from .analysis import structure as structure
    from .analysis import thermodynamics as thermodynamics
    from .analysis import transport as transport
    from .exchange import bridges as bridges
    from .exchange import foreign as foreign
    from .figures import drawing as drawing
    from .figures import film as film
    from .figures import film_data as film_data
    from .figures import sheet as sheet
    from .figures import web_page as web_page
    from .pages import actions as actions
    from .pages import encounters as encounters
    from .pages import lab as lab
    from .pages import live as live
    from .pages import numbers as numbers
    from .pages import worker as worker
    from .predictions import hard_disks as hard_disks
    from .predictions import mixtures as mixtures
    from .predictions import theory as theory
    from .predictions import walls as walls
    from .reading import arrays as arrays
    from .reading import box as box
    from .reading import changed as changed
    from .reading import contacts as contacts
    from .reading import files as files
    from .reading import frames as frames
    from .reading import nature as nature
    from .reading import paths as paths
    from .reading import pressure as pressure
    from .reading import reader as reader
    from .reading import records as records
    from .reading import results as results
    from .reading import units as units
    from .reading import windows as windows
    from .reports import groups as groups
    from .reports import options as options
    from .reports import registry as registry
    from .reports import result as result
    from .reports import tables as tables
    from .running import engine as engine
    from .running import ensembles as ensembles
    from .running import inputs as inputs
    from .running import program as program
    from .running import session as session
    from .running import simulation as simulation
    from .running import starting as starting
    from .running import state as state
else:
    ALIASES = Aliases()
    sys.meta_path.append(ALIASES)

    def __getattr__(name: str) -> object:
        """Return the module with the given short name."""
        if name in ALIASES.modules:
            return import_module(f"{__name__}.{name}")
        near = did_you_mean(name, __dir__())
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{near}")

    def __dir__() -> list[str]:
        return sorted({*globals(), *ALIASES.modules})
