"""How many collisions do time steps miss?

    python post/missed.py runs/gravity/rates/*.h5 -o missed.png --csv missed.csv

Give event-driven runs, and runs by time steps with the same seeds.  For each step dt: the share of
pair collisions that is missing against the event-driven run of the same seed, after the time
--after, averaged over the seeds; beside it what the rule of the steps makes one expect.

Two disks with the relative speed g and the impact parameter b overlap on a chord of length 2 l,
l = sqrt(s^2 - b^2), s their diameter.  They approach on its first half only, for the time l / g:
noticed later they recede already, and fly on.  Steps come at any phase, so a collision is missed
with the probability 1 - l / (g dt) if that is positive.  With b uniform in -s..s and q = g dt / s
the mean is

    P(q) = 1 - sqrt(1 - q^2) - (asin q - q sqrt(1 - q^2)) / (2 q)    for q < 1,
    P(q) = 1 - pi / (4 q)                                            beyond; q^2 / 6 for small q.

Colliding pairs have relative speeds of density ~ g^2 exp(-mu g^2 / 2 kT), mu their reduced mass;
pairs of species i and j collide at a rate ~ N_i N_j / (h_i + h_j) / sqrt(mu), where h = kT / (m g)
are their scale heights.
"""

from typing import NamedTuple

import numpy as np

from drawing import (
    COLOURS,
    caption,
    command_line,
    grouped,
    launch,
    plt,
    print_table,
    read_all,
    save,
    write_csv,
)
from read_run import Run, RunError
from theory import Estimate, estimate

SPEEDS = np.linspace(0, 12, 2001)  # in units of sqrt(kT / mu)


class Missed(NamedTuple):
    """Of all runs with one step."""

    dt: float
    runs: int
    temperature: float
    rate: Estimate  # pair collisions per disk and time
    share: Estimate  # 1 - rate by steps / rate by events
    expected: float


def missed_share(q: np.ndarray) -> np.ndarray:
    """P(q), the share of collisions missed at the relative speed g, q = g dt / s."""
    q = np.asarray(q, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        short = np.minimum(q, 1)
        root = np.sqrt(1 - short**2)
        below = 1 - root - (np.arcsin(short) - short * root) / (2 * short)
        share = np.where(q < 1, below, 1 - np.pi / (4 * q))
    return np.where(q < 1e-3, q**2 / 6, share)


def missed_by_pair(step: float, temperature: float, reduced: float, diameter: float) -> float:
    """P averaged over the colliding pairs of one kind in equilibrium."""
    weight = SPEEDS**2 * np.exp(-(SPEEDS**2) / 2)
    q = np.sqrt(temperature / reduced) * SPEEDS * step / diameter
    return float(np.average(missed_share(q), weights=weight))


def pair_weights(run: Run, temperature: float) -> np.ndarray:
    """(S, S) collision rates of pairs of species, i <= j, up to a factor."""
    masks = [run.of_species(name) for name in run.names]
    count = np.array([mask.sum() for mask in masks], dtype=float)
    mass, radius = (np.array([a[mask][0] for mask in masks]) for a in (run.mass, run.radius))
    reduced = mass[:, None] * mass / (mass[:, None] + mass)
    pairs = np.triu(np.outer(count, count), 1) + np.diag(count * (count - 1) / 2)
    weight = pairs * (radius[:, None] + radius) / np.sqrt(reduced)
    pull = float(np.linalg.norm(run.gravity))
    if pull > 0:
        height = temperature / (mass * pull)
        weight /= height[:, None] + height
    return weight


def expected_share(run: Run, step: float, temperature: float) -> float:
    """P averaged over all kinds of pairs of a dilute gas in equilibrium."""
    first = [np.flatnonzero(run.of_species(name))[0] for name in run.names]
    weight = pair_weights(run, temperature)
    share = np.zeros_like(weight)
    for i, j in zip(*np.nonzero(weight), strict=True):
        a, b = first[i], first[j]
        reduced = run.mass[a] * run.mass[b] / (run.mass[a] + run.mass[b])
        share[i, j] = missed_by_pair(step, temperature, reduced, run.radius[a] + run.radius[b])
    return float(np.sum(weight * share) / np.sum(weight))


def step_of(run: Run) -> float:
    """dt; zero for an event-driven run."""
    steps = run.parameter("run", "dynamics", "events") == "steps"
    return float(run.parameter("run", "dt")) if steps else 0.0


def rate_after(run: Run, after: float) -> float:
    """Pair collisions per disk and time, both disks counted, from `after` to the end."""
    time, collisions = run.collisions_per_disk
    first = int(np.searchsorted(time, after))
    if first >= len(time) - 1:
        raise RunError(f"{run.path}: ends before two samples after t = {after:g}")
    return float((collisions[-1] - collisions[first]) / (time[-1] - time[first]))


def temperature_after(run: Run, after: float) -> float:
    """kT, the mean kinetic energy per disk."""
    time, energy = run.observable("all/kinetic_energy")
    return float(energy[time >= after].mean())


def compare(runs: list[Run], after: float) -> list[Missed]:
    """A row per step; the event-driven runs come first, with dt = 0."""
    groups = grouped(runs, step_of)
    if groups[0][0] != 0 or len(groups) < 2:
        raise RunError("event-driven runs and runs by time steps are needed")
    exact = {run.seed: rate_after(run, after) for run in groups[0][1]}
    rows = []
    for step, members in groups:
        pairs = [run for run in members if run.seed in exact]
        if not pairs:
            raise RunError(f"no seed of dt = {step:g} has an event-driven run")
        rates = np.array([rate_after(run, after) for run in pairs])
        share = 1 - rates / [exact[run.seed] for run in pairs]
        kt = float(np.mean([temperature_after(run, after) for run in pairs]))
        expected = expected_share(pairs[0], step, kt)
        rows.append(Missed(step, len(pairs), kt, estimate(rates), estimate(share), expected))
    return rows


def draw(runs: list[Run], rows: list[Missed]) -> plt.Figure:
    """The share that is missed against dt, measured and expected."""
    figure, axes = plt.subplots(figsize=(6.5, 4.5))
    steps = rows[1:]
    dt = np.array([row.dt for row in steps])
    kt = float(np.mean([row.temperature for row in steps]))
    curve = np.geomspace(dt.min() / 1.5, dt.max() * 1.5, 50)
    axes.plot(
        curve,
        [100 * expected_share(runs[0], step, kt) for step in curve],
        color="black",
        lw=1.2,
        label="expected: noticed only after the closest approach",
    )
    axes.errorbar(
        dt,
        [100 * row.share.mean for row in steps],
        [100 * row.share.error for row in steps],
        ls="",
        marker="o",
        color=COLOURS[0],
        capsize=3,
        label=f"measured, {steps[0].runs} pairs of runs",
    )
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="Δt (reduced units)",
        ylabel="pair collisions missed [%]",
        title=caption(runs),
    )
    axes.set_xticks(dt, [f"{step:g}" for step in dt], minor=False)
    axes.set_xticks([], minor=True)
    axes.legend(loc="upper left")
    return figure


def main() -> None:
    parser = command_line(__doc__, "missed.png", table=True)
    parser.add_argument("--after", type=float, default=20, help="time of equilibrium [20]")
    args = parser.parse_args()
    runs = read_all(args.runs)
    rows = compare(runs, args.after)
    table = {
        "dt": [row.dt for row in rows],
        "runs": [row.runs for row in rows],
        "kT": [row.temperature for row in rows],
        "rate": [float(row.rate.mean) for row in rows],
        "missed_percent": [100 * float(row.share.mean) for row in rows],
        "missed_error": [100 * float(row.share.error) for row in rows],
        "expected_percent": [100 * row.expected for row in rows],
    }
    print_table(table)
    save(draw(runs, rows), args.output, runs, "Missed collisions")
    if args.csv:
        write_csv(args.csv, table)


if __name__ == "__main__":
    launch(main)
