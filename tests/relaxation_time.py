"""Plot how a melting crystal reaches equilibrium: event chains against event-driven dynamics.

    python tests/relaxation_time.py [docs/explanation/event_chains.png]

All runs start from the same lattice of 256 disks at a packing fraction of 0.702, where the
equilibrium is a liquid with large ordered regions. The figure shows the global bond-orientational
order, averaged over runs with different seeds, against the number of events per disk: displacements
in event chains (placement = 'relaxed'), or collisions in a run that starts with
placement = 'lattice'. The program is build/ricochet, or the one that the variable RICOCHET names.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "post"))

import numpy as np
from matplotlib.figure import Figure

from ricochet import Run, program, read_run
from ricochet.analysis.structure import bond_order

ROOT = Path(__file__).resolve().parents[1]
COUNT, PACKING, SEEDS = 256, 0.702, range(1, 17)
SWEEPS = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500)
TAUS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000)


def run_of(folder: Path, seed: int, **species) -> Run:
    """Execute a run and return its output."""
    groups = {"run": {"seed": seed}, "box": {"boundary": ("periodic", "periodic")}}
    groups["species"] = {"count": COUNT, "packing_fraction": PACKING, "temperature": 1.0} | species
    relaxed = "relaxation_sweeps" in species
    groups["stop"] = {"collisions_per_disk": 0.01 if relaxed else max(TAUS)}
    if not relaxed:
        groups["output"] = {"frames_every_collisions_per_disk": 1}
    path = folder / "run.nml"
    path.write_text(program.namelist(groups))
    command = [os.environ.get("RICOCHET", ROOT / "build" / "ricochet"), path, "-o"]
    command += [path.with_suffix(".h5"), "--force", "--quiet"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return read_run(path.with_suffix(".h5"))


def order(run: Run, frame: int) -> float:
    """Return the modulus of the mean psi6 in one frame."""
    return abs(bond_order(run, frame).mean())


def measure(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the order for each seed and number of sweeps, or of collisions per disk."""
    chains = [
        [order(run_of(folder, s, placement="relaxed", relaxation_sweeps=n), 0) for n in SWEEPS]
        for s in SEEDS
    ]
    dynamics = []
    for seed in SEEDS:
        run = run_of(folder, seed, placement="lattice")
        dynamics.append([order(run, min(tau, run.n_frames - 1)) for tau in TAUS])
    return np.array(chains), np.array(dynamics)


def main() -> None:
    shown = ROOT / "docs" / "explanation" / "event_chains.png"
    target = Path(sys.argv[1] if len(sys.argv) > 1 else shown)
    with tempfile.TemporaryDirectory() as folder:
        chains, dynamics = measure(Path(folder))
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot()
    for events, values, marker, label in (
        (np.sqrt(COUNT) * np.array(SWEEPS), chains, "o", "event chains ('relaxed')"),
        (np.array(TAUS), dynamics, "s", "event-driven dynamics from 'lattice'"),
    ):
        error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
        axes.errorbar(events, values.mean(axis=0), error, marker=marker, lw=1, label=label)
    axes.set_xscale("symlog", linthresh=1)
    axes.set(xlabel="events per disk", ylabel=r"$|\langle\psi_6\rangle|$", ylim=(0, 1.02))
    axes.set_title(f"{COUNT} disks from a lattice, packing {PACKING}")
    axes.legend()
    figure.savefig(target, dpi=120)
    print(target)
    for name, values in (("chains", chains), ("dynamics", dynamics)):
        print(name, *(f"{mean:.3f}" for mean in values.mean(axis=0)))


if __name__ == "__main__":
    main()
