"""Speed distributions in the first frame, in the last frame and in equilibrium.

    python post/speeds.py runs/gas/*.h5 -o speeds.png --csv speeds.csv

The figure shows histograms of the reduced speed u = v / sqrt(2 kT / m), where kT is the mean
kinetic energy of the species.  The equilibrium distribution of u is P(u) = 2 u exp(-u^2) for any
mass.  If m = 1 and all initial speeds are 1, u equals v.  With --unscaled the histograms show v in
units of the input.  Runs with the same number of disks N are combined.  Equilibrium, or the steady
state of a driven gas, begins after the first X collisions per disk, where X is the value of
--equilibration, or by default when no observable drifts any longer.  Frames selected by --frames
are used only if they are at least X collisions per disk apart, where X is the value of
--min-separation.  The temperature kT is the mean over the frames that are used.  In a sheared box,
speeds are measured relative to the mean flow.  A gas that only loses energy does not reach a steady
state.  The histogram of a gas that only loses energy contains the frames after the first X
collisions per disk, where X is the value of --equilibration (by default 15), and the speeds in each
frame are scaled with kT of that frame.  If sides of the box move or if kT drifts, the speeds in
each frame are also scaled with kT of that frame; then `kT_first` and `kT_last` show the change of
kT.  Each species of a mixture has a separate row in the table and a separate curve.  Each row
contains the temperature kT, and the temperatures kT_x and kT_y of both velocity components.
Kolmogorov-Smirnov (KS) and chi-square tests compare the speeds with the expected distribution.
Before the tests, the speeds in each frame are divided by the thermal speed in that frame.  If the
kinetic energy is conserved, the expected distribution is that of N disks with a fixed total kinetic
energy; otherwise the Maxwell distribution is expected.  The p-values are determined from random
samples; the speeds in each sample are divided by the thermal speed of this sample
(docs/explanation/statistics.md).  Frames that are close in time contain correlated speeds;
therefore the number of `independent` speeds is reduced by the statistical inefficiency.  The
statistical tests do not apply to disks that conserve their angular momentum in a round container.
The table contains the mean of u, and the mean of u^4 as `kurtosis`, which is 2 for the Maxwell
distribution; speeds are scaled so that the mean of u^2 is 1.  The column `a2` contains the second
Sonine coefficient a2 = <v^4> / (2 <v^2>^2) - 1 of all speeds that are used, with its error.  The
last panel shows a2 of single frames against the number of collisions per disk.
"""

from typing import NamedTuple

from ricochet import Run, RunError
from ricochet.analysis.speed_laws import speed_test
from ricochet.analysis.speeds import (
    all_move,
    kt_of_frames,
    moment,
    reduced_speeds,
    relaxation,
)
from ricochet.analysis.statistics import (
    Estimate,
    SeriesMean,
    binned,
    combine_runs,
    has_drift,
    estimate,
    has_trend,
    correlated_mean,
    rounded_to_error,
)
from ricochet.analysis.equilibrium import motion_notes, refuse_others
from ricochet.figures.drawing import bars, caption, colours, dilute_limit, noise_band, plt
from ricochet.predictions.theory import RELAXATION, maxwell_cdf, maxwell_pdf
from ricochet.reading.nature import TRAITS, Refused, allow
from ricochet.script import command_line, grouped, late_frames, launch, measured, report

import numpy as np

BINS = np.linspace(0, 3, 51)  # u = 1 is the centre of a bin
# Panel titles, one for each possible state of the gas in the late frames (the frames after the
# initial relaxation).  The titles `EQUILIBRIUM` and `STEADY` are used if the average of kT does not
# change during the late frames.
EQUILIBRIUM, STEADY = "Equilibrium, many frames", "Steady state, many frames"
COOLING, MOVING = "No equilibrium: each frame at its own kT", "Sides move: each frame at its own kT"
UNSTEADY = "No steady kT yet: each frame at its own"
A2 = "second Sonine coefficient $a_2$"
ABOUT_A2 = (
    "$a_2 = \\langle v^4 \\rangle\\,/\\,2\\langle v^2 \\rangle^2 - 1$: "
    "0 for Maxwell's speeds, $-1/2$ for equal speeds.\n"
    "Each point is one frame. Deviations last for about 2 collisions per disk,\n"
    "so that neighbouring points may lie outside the band together."
)


def state_of(run: Run) -> str:
    """Return the state in the late frames: equilibrium, a steady state, or a changing state."""
    if run.n_disks < 3:
        raise Refused(
            f"{run.path}: needs at least three disks, whose collisions establish a "
            "distribution of speeds"
        )
    known = set(TRAITS) - {"changed", "collapsed", "sliding_surfaces"}
    allow(run, "its speed distribution depends on the position; see fields.py", *known)
    if run.nature.cooling or "moving_sides" in run.nature:
        return COOLING if run.nature.cooling else MOVING
    return EQUILIBRIUM if run.nature.in_equilibrium else STEADY


def temperature(
    runs: list[Run], picked: list[list[int]], species: str | None = None
) -> tuple[SeriesMean, list[float], bool]:
    """Return the mean kT of the frames, kT of the first and last frame, and whether kT drifts."""
    tracks = tracks_of(runs, picked, species)
    kt = combine_runs([correlated_mean(track) for track in tracks])
    alone = species is None or len(runs[0].names) == 1
    if alone and all(run.nature.keeps_kinetic_energy for run in runs):
        kt = kt._replace(error=0.0, drift=0.0)  # however few there are
    ends = [float(np.mean([track[k] for track in tracks])) for k in (0, -1)]
    return kt, ends, has_drift(kt) or any(map(has_trend, tracks))


def tracks_of(
    runs: list[Run], picked: list[list[int]], species: str | None, component: int | None = None
) -> list[np.ndarray]:
    """Return kT in all frames between the first and the last selected frame of each run."""
    spans = [slice(frames[0], frames[-1] + 1) for frames in picked]
    return [
        kt_of_frames(run, own, species, component) for run, own in zip(runs, spans, strict=True)
    ]


def pooled(
    runs: list[Run], picked: list[list[int]], state: str, name: str
) -> tuple[Estimate, dict]:
    """Return the speed density (B,) of a species in late frames, and statistical test results."""
    own, each = zip(runs, picked, strict=True), state not in (EQUILIBRIUM, STEADY)
    members = [reduced_speeds(*one, each=each, species=name) for one in own]
    members = [u.reshape(len(frames), -1) for u, frames in zip(members, picked, strict=True)]
    u = np.concatenate([one.ravel() for one in members])
    test, several = speed_test(runs, picked, name), len(runs[0].names) > 1
    kt, ends, _ = temperature(runs, picked, name)
    parts = {} if state == COOLING else measured("kT", kt)
    for k, axis in enumerate("xy") if parts else ():
        means = [correlated_mean(track) for track in tracks_of(runs, picked, name, k)]
        parts |= measured(f"kT_{axis}", combine_runs(means))
    fourth = moment(members, 4, test.independent)
    row = {
        "N": runs[0].n_disks,
        **({"species": name} if several else {}),
        "runs": len(runs),
        "frames": sum(map(len, picked)),
        "speeds": len(u),
        "independent": round(test.independent),
        **parts,
        "kT_first": ends[0],
        "kT_last": ends[1],
        **measured("mean_u", moment(members, 1, test.independent)),
        **measured("kurtosis", fourth),
        **measured("a2", Estimate(fourth.mean / 2 - 1, fourth.error / 2)),
        "law": test.law,
        "KS_D": test.ks,
        "KS_p": test.ks_p,
        "chi2/dof": test.chi2,
        "chi2_p": test.chi2_p,
    }
    return binned(u, BINS, max(1, round(test.independent))), row


class Scale(NamedTuple):
    """Axis of speeds, with labels and with the thermal speed in units of the axis."""

    thermal: float = 1.0  # sqrt(2 kT / m), or 1
    label: str = "speed $u = v\\,/\\,\\sqrt{2kT/m}$"
    density: str = "probability density $P(u)$"  # label of the other axis

    @property
    def law(self) -> str:
        """Return the Maxwell distribution as text for the legend of a figure."""
        if self.thermal == 1.0 and "u" in self.label:
            return "Maxwell, $P(u)=2u\\,e^{-u^2}$"
        return "Maxwell, $P(v)=(mv/kT)\\,e^{-mv^2/2kT}$"


def scale_of(run: Run, kt: float, unscaled: bool) -> Scale:
    """Return the axis of speeds at a temperature, for v if `unscaled` is true, otherwise for u."""
    if not unscaled:
        return Scale()
    labels = (
        run.units.label("speed v", "speed"),
        run.units.label("probability density $P(v)$", "1/speed"),
    )
    return Scale(float(np.sqrt(2 * kt / run.mass[0])), *labels)


def draw_histogram(
    axes: plt.Axes, heights: list[Estimate], labels: list[str], scales: list[Scale]
) -> None:
    """Draw histograms of speeds as steps, and a Maxwell distribution for each scale of speeds."""
    style = {"fill": True, "alpha": 0.45} if len(heights) == 1 else {"fill": False}
    each = zip(heights, labels, scales, colours(len(labels)), strict=True)
    for height, label, scale, colour in each:
        density = Estimate(*(np.asarray(part) / scale.thermal for part in height))
        bars(axes, density, BINS * scale.thermal, color=colour, label=label, lw=1.6, **style)
    fine = np.linspace(0, 3, 301)
    for scale in dict.fromkeys(scales):
        law = maxwell_pdf(fine) / scale.thermal
        axes.plot(fine * scale.thermal, law, color="black", lw=1.2, label=scale.law)
    axes.set(xlabel=scales[0].label, xlim=(0, 3 * max(scale.thermal for scale in scales)))
    axes.set_ylabel(scales[0].density)
    axes.legend()


def draw_relaxation(axes: plt.Axes, groups: list) -> None:
    """Draw the mean of a2 over the runs, and its error, against collisions per disk."""
    equal = True
    for (count, runs), colour in zip(groups, colours(len(groups)), strict=True):
        tracks = [relaxation(run) for run in runs]
        common = min(len(tau) for tau, _ in tracks)
        if common == 0:
            equal = False
            continue
        tau = np.mean([track[:common] for track, _ in tracks], axis=0)
        a2 = estimate([track[:common] for _, track in tracks])
        error = a2.error if len(runs) > 1 else None
        axes.errorbar(tau, a2.mean, error, color=colour, marker=".", lw=1, label=f"N = {count}")
        label = "95 % in equilibrium" + f", N = {count}" * (len(groups) > 1)
        noise_band(axes, count * len(runs), colour, label)
        closed = all(run.nature <= {"obstacles", "rotating", "walls"} for run in runs)
        equal = equal and closed and max(a[0] for _, a in tracks) < -0.4
    if equal:
        dilute_limit(axes, RELAXATION)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    axes.set(xlabel="collisions per disk", ylabel=A2)
    low, high = axes.get_ylim()
    low -= 0.32 * (high - low)  # space for the explanation below the points
    legend = 0.04 + 0.08 * len(axes.get_legend_handles_labels()[0])  # its share of the panel
    axes.set_ylim(low, low + (high - low) / (1 - legend))
    axes.text(0.98, 0.02, ABOUT_A2, ha="right", va="bottom", fontsize=8, transform=axes.transAxes)
    axes.legend(loc="upper right")


def cooling(row: dict) -> str:
    """Return the change of kT as text; kT usually falls, but can increase under gravity."""
    goes = "falls" if row["kT_last"] < row["kT_first"] else "goes"
    if row["frames"] == row["runs"]:
        return f"kT is {row['kT_last']:.4g}"
    return f"kT {goes} from {row['kT_first']:.4g} to {row['kT_last']:.4g}"


def label_of(row: dict, state: str) -> str:
    """Return the temperature and the results of the statistical tests as text."""
    size, free = row["speeds"], row["independent"]
    words = ", ".join(filter(None, (f"N = {row['N']}", row.get("species")))) + f": {size} speeds"
    words += f", {free} independent" if free < size else ""
    steady = state in (STEADY, MOVING)
    words += f"\nkT = {' ± '.join(rounded_to_error(row['kT'], row['kT_error']))}" if steady else ""
    words += f"\n{cooling(row)}" if state in (COOLING, UNSTEADY) else ""
    laws = {"Maxwell": "Maxwell", "fixed_energy": "N disks that share a fixed energy"}
    if row["law"] not in laws:
        return words
    return f"{words}\nKS test: {chance(row['KS_p'])} for {laws[row['law']]}"


def chance(p: float) -> str:
    """Return a p-value as text, which is never "0" or "1"."""
    return "p < 0.0001" if p < 1e-4 else f"p = {min(p, 0.9999):.4f}"


def draw(
    runs: list[Run], groups: list, pools: list, state: str, unscaled: bool = False
) -> plt.Figure:
    """Draw four panels: speeds in the first, last and late frames, and the relaxation of a2."""
    figure, ((first, last), (late, way)) = plt.subplots(2, 2, figsize=(10, 7))
    largest = groups[-1][1][0]
    for axes, frame, when in ((first, 0, "first frame"), (last, -1, f"t = {largest.time[-1]:.4g}")):
        if all_move(largest, frame):
            height = binned(reduced_speeds(largest, [frame]), BINS)
            kt = float(kt_of_frames(largest, [frame])[0])
            scales = [scale_of(largest, kt, unscaled)]
            draw_histogram(axes, [height], [f"{when}, N = {largest.n_disks}"], scales)
        else:
            axes.set_axis_off()
            axes.text(0.5, 0.5, f"{when}: disks at rest", ha="center", transform=axes.transAxes)
    densities, rows = zip(*pools, strict=True)
    scales = [scale_of(largest, row.get("kT", 0.0), unscaled) for row in rows]
    draw_histogram(late, densities, [label_of(row, state) for row in rows], scales)
    top = max(
        max(1.0, np.max(density.mean)) / scale.thermal
        for density, scale in zip(densities, scales, strict=True)
    )
    room = 0.1 + (0.4 if state in (EQUILIBRIUM, STEADY) else 0.6) * len(rows)
    late.set_ylim(0, top * (1 + room))
    draw_relaxation(way, groups)
    first.set_title("Start")
    last.set_title("One frame at the end")
    late.set_title(state)
    way.set_title("The way " + ("to equilibrium" if state == EQUILIBRIUM else "there"))
    figure.suptitle(caption(runs))
    return figure


def check_unscaled(runs: list[Run], state: str) -> None:
    """Raise an error if --unscaled is used but masses or temperatures in late frames differ."""
    for run in runs:
        if np.ptp(run.mass) > 0:
            raise RunError(
                f"{run.path}: its disks have several masses; mixture.py draws unscaled speeds of "
                "each species"
            )
        if state not in (EQUILIBRIUM, STEADY):
            raise RunError(f"{run.path}: its kT is not steady, which --unscaled requires")


def main() -> None:
    parser = command_line(
        __doc__, "speeds.png", frames=None, equilibration=None, min_separation=5.0
    )
    meaning = "draw speeds v in units of the input instead of u; all disks must have the same mass"
    parser.add_argument("--unscaled", action="store_true", help=meaning)
    args = parser.parse_args()
    state, *others = map(state_of, args.runs)
    if any(other != state for other in others):
        odd = args.runs[1 + [other != state for other in others].index(True)]
        raise RunError(
            f"{odd.path}: differs in kind from {args.runs[0].path}: draw them separately"
        )
    groups = grouped(args.runs, lambda run: run.n_disks)
    for _, runs in groups:
        refuse_others(runs)
    picked = [[late_frames(run, args) for run in members] for _, members in groups]
    found = [temperature(runs, own) for (_, runs), own in zip(groups, picked, strict=True)]
    if state in (EQUILIBRIUM, STEADY) and any(drift for *_, drift in found):
        state = UNSTEADY
    pools, data, notes = [], {"u_low": BINS[:-1], "u_high": BINS[1:]}, motion_notes(args.runs)
    for (count, runs), own in zip(groups, picked, strict=True):
        for name in runs[0].names:
            density, row = pooled(runs, own, state, name)
            end = f"N{count}_{name}" if "species" in row else f"N{count}"
            data[f"density_{end}"], data[f"density_error_{end}"] = density
            pools.append((density, row))
            if state in (COOLING, UNSTEADY):
                why = "loses energy, no equilibrium" if state == COOLING else "has no steady kT yet"
                whose = f"N = {count}, {name}" if "species" in row else f"N = {count}"
                notes.append(f"{whose}: {why}; {cooling(row)}")
    data["maxwell"] = np.diff(maxwell_cdf(BINS)) / np.diff(BINS)
    if args.unscaled:
        check_unscaled(args.runs, state)
    figure = draw(args.runs, groups, pools, state, args.unscaled)
    report(args, figure, [row for _, row in pools], data=data, notes=notes)


if __name__ == "__main__":
    launch(main)
