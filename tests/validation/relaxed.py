"""Section 16 of the report: dense initial states equilibrated by event chains.

No part of a run is discarded as equilibration, and several initial states are averaged. The
published pressures are for the same number of disks and the same shape of the box, so that no
finite-size correction is needed, with one exception: for 4096 disks at a packing fraction of 0.698
the reference is that for 256^2 disks (Engel et al., Physical Review E 87, 042134 (2013), 9.1708).
Published values for 870 and 128^2 disks are 9.1341 and 9.1741 (Li et al., Journal of Chemical
Physics 157, 234111 (2022)), so that the correction for 4096 disks lies between -0.4 and +0.04 %; if
proportional to 1/N, it is -0.08 %.
"""

from math import pi, sqrt

import numpy as np

from ricochet import Run
from ricochet.analysis.structure import bond_order

from .case import AT_LEAST, AT_MOST, Case, Member, relative, sigmas
from .estimators import over
from .inputs import PERIODIC, ensemble

LI = "Li et al., J. Chem. Phys. 157, 234111 (2022)"
ENGEL = "Engel et al., Phys. Rev. E 87, 042134 (2013)"


def starts(
    seeds: int, count: int, eta: float, shape: tuple = (1.0, 1.0), *, tau: float, sweeps: int = 1000
) -> tuple[Member, ...]:
    """Return short runs of equal disks in a periodic box, with one sample at each end."""
    species = {"count": count, "packing_fraction": eta, "temperature": 1.0}
    species |= {"placement": "relaxed", "relaxation_sweeps": sweeps}
    box = {"upper": shape, **PERIODIC}
    return ensemble(seeds, box=box, species=species, stop={"collisions_per_disk": tau})


def pressure(run: Run) -> float:
    """Return P d^2 / kT from the virial of a whole run, with kT from N - 1 free velocities."""
    kt = np.sum(run.kinetic_energy(0)) / (run.n_disks - 1)
    z = 1 + run.observable("virial").value[-1] / (2 * run.n_disks * kt * run.time[-1])
    return z * run.n_disks * (2 * run.radius[0]) ** 2 / np.prod(run.edges)


def order(run: Run) -> float:
    """Return the global bond-orientational order of the start, the modulus of the mean psi6."""
    return abs(bond_order(run, 0).mean())


#: Height of the box over its width, and P d^2 / kT at a packing fraction of 0.73, for 72 disks.
SMALL = {8 * sqrt(3) / 18: 9.52740, 1.0: 10.08124}
#: The same for a box in which the crystal has several orientations, between which it rarely
#: changes. The initial state therefore requires ten times as many sweeps, and the pressures of
#: initial states differ more.
TURNING = (sqrt(3) / 2, 11.40956)
#: By packing fraction: P d^2 / kT of 870 disks in a square box, and the collisions per disk of a
#: run, long enough to average the slow fluctuations near melting.
SQUARE = {0.69: (8.969898, 2000), 0.698: (9.13414, 6000)}


def mixture(seeds: int) -> tuple[Member, ...]:
    """Return states of 1000 disks, half of them 1.4 times as large, at packing fraction 0.80."""
    small = sqrt(0.80 / (500 * pi * (1 + 1.4**2)))
    species = [
        {"name": name, "count": 500, "radius": radius, "placement": "relaxed", "temperature": 1.0}
        for name, radius in (("small", small), ("large", 1.4 * small))
    ]
    return ensemble(seeds, box=PERIODIC, species=species, stop={"collisions_per_disk": 1})


CASES = [
    *[
        Case(
            "P16-01", f"72 disks at packing 0.73, height {height:.3f} of the width: P d^2 / kT",
            starts(100, 72, 0.73, (1.0, height), tau=200), over(pressure),
            value, relative(0.003), LI,
        )
        for height, value in SMALL.items()
    ],
    Case(
        "P16-01", "72 disks at packing 0.73, crystal that turns: P d^2 / kT",
        starts(24, 72, 0.73, (1.0, TURNING[0]), tau=200, sweeps=10_000), over(pressure),
        TURNING[1], sigmas(3, 0.01), LI,
    ),
    *[
        Case(
            "P16-02", f"870 disks at packing {eta}: P d^2 / kT",
            starts(16, 870, eta, tau=tau), over(pressure),
            value, relative(0.003), LI,
        )
        for eta, (value, tau) in SQUARE.items()
    ],
    Case(
        "P16-03", "4096 disks at packing 0.698: P d^2 / kT of 256^2 disks",
        starts(8, 4096, 0.698, tau=4000, sweeps=300), over(pressure),
        9.1708, relative(0.003), ENGEL,
    ),
    Case(
        "P16-04", "870 disks at packing 0.67, a liquid: global orientational order",
        starts(4, 870, 0.67, tau=1), lambda *runs: np.mean([order(run) for run in runs]),
        0.3, AT_MOST, ENGEL,
    ),
    Case(
        "P16-04", "960 disks at packing 0.73, a solid: global orientational order",
        starts(4, 960, 0.73, (1.0, 32 / 30 * sqrt(3) / 2), tau=1),
        lambda *runs: np.mean([order(run) for run in runs]),
        0.6, AT_LEAST, ENGEL,
    ),
    Case(
        "P16-05", "radii 1 : 1.4 at packing 0.80: global orientational order",
        mixture(4), lambda *runs: np.mean([order(run) for run in runs]),
        0.15, AT_MOST, "glass former: no crystal",
    ),
]  # fmt: skip
