"""Speed distributions in the first frame, in the last frame and in equilibrium."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from ...analysis.equilibrium import motion_notes, refuse_others
from ...analysis.estimates import Estimate, binned, estimate, rounded_to_error
from ...analysis.speed_laws import speed_test
from ...analysis.speeds import (
    all_move,
    kt_in_strips,
    kt_of_frames,
    moment,
    reduced_speeds,
    relaxation,
)
from ...analysis.statistics import SeriesMean, combine_runs, correlated_mean, has_drift, has_trend
from ...figures.drawing import bars, caption, colours, dilute_limit, noise_band, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions.theory import RELAXATION, maxwell_cdf, maxwell_pdf
from ...reading.nature import TRAITS, Refused, allow
from ...reading.reader import Run, RunError
from ..groups import Group, by_number
from ..options import Option, late_frames, shared
from ..registry import Analysis
from ..result import Result
from ..tables import measured

BINS = np.linspace(0, 3, 51)  # u = 1 is at the centre of a bin
WIDE_BINS = np.linspace(0, 3.06, 18)  # for a histogram of up to `FEW_SPEEDS` speeds
FEW_SPEEDS = 300
STRIPS, UNEQUAL = 10, 1.5  # strips across a box between walls; ratio of their kT for a warning
# Titles of the panel of late frames (after the initial relaxation), by the state of the gas.
# `EQUILIBRIUM` and `STEADY` are used if the mean kT does not change in the late frames.
EQUILIBRIUM, STEADY = "Equilibrium, many frames", "Steady state, many frames"
COOLING, MOVING = "No equilibrium: each frame at its own kT", "Sides move: each frame at its own kT"
UNSTEADY = "No steady kT yet: each frame at its own"
ABOUT_A2 = (
    "The second Sonine coefficient is 0 for Maxwell's speeds and −1/2 for equal speeds. Each point "
    "is one frame; deviations are halved about every 2 collisions per disk."
)
BARS = "Bars: standard errors for the number of independent speeds"
OVER_RUNS = "; of the Sonine coefficient: over the runs"
ABOUT_BAND = (
    "95 % of points in equilibrium lie in the band; neighbouring points are correlated, and "
    "several in a row can lie outside."
)
UNSCALED = Option(
    "unscaled",
    "speeds v instead of u, for disks of equal mass",
    default=False,
    convert=bool,
)


class Pool(NamedTuple):
    """Density of the speeds of a species in late frames, and its row of the table."""

    density: Estimate
    row: dict[str, Any]


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
    """Return the mean kT of the frames, kT of the first and the last, and whether kT drifts."""
    tracks = tracks_of(runs, picked, species)
    kt = combine_runs([correlated_mean(track) for track in tracks])
    alone = species is None or len(runs[0].names) == 1
    if alone and all(run.nature.keeps_kinetic_energy for run in runs):
        kt = kt._replace(error=0.0, drift=0.0)  # however few frames there are
    ends = [float(np.mean([track[k] for track in tracks])) for k in (0, -1)]
    return kt, ends, has_drift(kt) or any(map(has_trend, tracks))


def tracks_of(
    runs: list[Run], picked: list[list[int]], species: str | None, component: int | None = None
) -> list[np.ndarray]:
    """Return kT in all frames from the first to the last selected one of each run."""
    spans = [slice(frames[0], frames[-1] + 1) for frames in picked]
    return [
        kt_of_frames(run, own, species, component) for run, own in zip(runs, spans, strict=True)
    ]


def pooled(runs: list[Run], picked: list[list[int]], state: str, name: str) -> Pool:
    """Return the speed density (B,) of a species in late frames, with results of the tests."""
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
    return Pool(binned(u, BINS, max(1, round(test.independent))), row)


class Scale(NamedTuple):
    """Axis of speeds: labels, and the thermal speed in units of the axis."""

    thermal: float = 1.0  # sqrt(2 kT / m), or 1
    label: str = "speed $u = v\\,/\\,\\sqrt{2kT/m}$"
    density: str = "probability density $P(u)$"  # label of the other axis

    @property
    def law(self) -> str:
        """Return the Maxwell distribution as text for a legend."""
        if self.thermal == 1.0 and "u" in self.label:
            return "Maxwell, P(u) = 2u exp(−u²)"
        return "Maxwell, P(v) = (mv/kT) exp(−mv²/2kT)"


def scale_of(run: Run, kt: float, unscaled: bool) -> Scale:
    """Return the axis of speeds at a temperature, for v if `unscaled`, otherwise for u."""
    if not unscaled:
        return Scale()
    labels = (
        run.units.label("speed v", "speed"),
        run.units.label("probability density $P(v)$", "1/speed"),
    )
    return Scale(float(np.sqrt(2 * kt / run.mass[0])), *labels)


def draw_histogram(
    axes: plt.Axes,
    heights: Sequence[Estimate],
    labels: Sequence[str],
    scales: Sequence[Scale],
    shades: Sequence[str],
    bins: np.ndarray = BINS,
) -> None:
    """Plot histograms of speeds as steps, with a Maxwell distribution for each scale."""
    style = {"fill": True, "alpha": 0.45} if len(heights) == 1 else {"fill": False}
    each = zip(heights, labels, scales, shades, strict=True)
    for height, label, scale, colour in each:
        density = Estimate(*(np.asarray(part) / scale.thermal for part in height))
        bars(axes, density, bins * scale.thermal, color=colour, label=label, lw=1.6, **style)
    fine = np.linspace(0, 3, 301)
    for scale in dict.fromkeys(scales):
        law = maxwell_pdf(fine) / scale.thermal
        axes.plot(fine * scale.thermal, law, color="black", lw=1.2, label=scale.law)
    axes.set(xlabel=scales[0].label, xlim=(0, 3 * max(scale.thermal for scale in scales)))
    axes.set_ylabel(scales[0].density)
    legend_above(axes)


def draw_frame(axes: plt.Axes, group: Group, frame: int, title: str, unscaled: bool) -> None:
    """Plot the speed distribution in one frame."""
    run = group.runs[0]
    axes.set_title(title)
    if not all_move(run, frame):
        axes.set_axis_off()
        axes.text(0.5, 0.5, "disks at rest", ha="center", transform=axes.transAxes)
        return
    bins = WIDE_BINS if run.n_disks <= FEW_SPEEDS else BINS
    height = binned(reduced_speeds(run, [frame]), bins)
    scale = scale_of(run, float(kt_of_frames(run, [frame])[0]), unscaled)
    label = f"t = {run.time[frame]:.4g}, N = {run.n_disks}"
    draw_histogram(axes, [height], [label], [scale], [group.colour], bins)


def draw_late(axes: plt.Axes, result: Result) -> None:
    """Plot the speed distributions in late frames."""
    pools = [pool for group in result.groups for pool in group.values]
    run = result.groups[-1].runs[0]
    scales = [scale_of(run, pool.row.get("kT", 0.0), result.options.unscaled) for pool in pools]
    names = [name_of(pool.row) for pool in pools]
    axes.set_title(result.values)
    draw_histogram(axes, [pool.density for pool in pools], names, scales, colours(len(pools)))
    axes.set_ylim(0, None)


def draw_relaxation(axes: plt.Axes, groups: list[Group], state: str) -> None:
    """Plot the mean of a2 over the runs, with its error, against collisions per disk."""
    equal = True
    for group in groups:
        tracks = [relaxation(run) for run in group.runs]
        common = min(len(tau) for tau, _ in tracks)
        if common == 0:
            equal = False
            continue
        tau = np.mean([track[:common] for track, _ in tracks], axis=0)
        a2 = estimate([track[:common] for _, track in tracks])
        error = a2.error if len(group.runs) > 1 else None
        style = {"color": group.colour, "marker": ".", "lw": 1, "label": f"N = {group.key}"}
        axes.errorbar(tau, a2.mean, error, **style)
        label = "95 % in equilibrium" + f", N = {group.key}" * (len(groups) > 1)
        noise_band(axes, group.key * len(group.runs), group.colour, label)
        closed = all(run.nature <= {"obstacles", "rotating", "walls"} for run in group.runs)
        equal = equal and closed and max(a[0] for _, a in tracks) < -0.4
    if equal:
        dilute_limit(axes, RELAXATION)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    axes.set(xlabel="collisions per disk", ylabel="second Sonine coefficient")
    axes.set_title("The way " + ("to equilibrium" if state == EQUILIBRIUM else "there"))
    legend_above(axes)


def name_of(row: dict[str, Any]) -> str:
    """Return the number of disks and the species as text."""
    return ", ".join(filter(None, (f"N = {row['N']}", row.get("species"))))


def cooling(row: dict[str, Any]) -> str:
    """Return the change of kT as text; kT usually falls, but may rise under gravity."""
    goes = "falls" if row["kT_last"] < row["kT_first"] else "goes"
    if row["frames"] == row["runs"]:
        return f"kT is {row['kT_last']:.4g}"
    return f"kT {goes} from {row['kT_first']:.4g} to {row['kT_last']:.4g}"


def told(row: dict[str, Any], state: str) -> str:
    """Return the temperature and the results of the tests as text."""
    size, free = row["speeds"], row["independent"]
    words = f"{name_of(row)}: {size} speeds" + f", {free} independent" * (free < size)
    if state in (STEADY, MOVING):
        words += f"; kT = {' ± '.join(rounded_to_error(row['kT'], row['kT_error']))}"
    if state in (COOLING, UNSTEADY):
        words += f"; {cooling(row)}"
    laws = {"Maxwell": "Maxwell", "fixed_energy": "N disks that share a fixed energy"}
    if row["law"] in laws:
        words += f"; KS test: {chance(row['KS_p'])} for {laws[row['law']]}"
    return f"{words}."


def chance(p: float) -> str:
    """Return a p-value as text, never "0" or "1"."""
    return "p < 0.0001" if p < 1e-4 else f"p = {min(p, 0.9999):.4f}"


def draw(result: Result) -> Sheet:
    """Plot speeds in the first, the last and the late frames, and the relaxation of a2."""
    largest, unscaled = result.groups[-1], result.options.unscaled
    first = Panel("start", draw_frame, (largest, 0, "Start", unscaled))
    last = Panel("end", draw_frame, (largest, -1, "One frame at the end", unscaled))
    late = Panel("late", draw_late, (result,))
    way = Panel("relaxation", draw_relaxation, (result.groups, result.values))
    return Sheet([[first, last], [late, way]], caption(result.runs))


def check_unscaled(runs: list[Run], state: str) -> None:
    """Raise RunError if --unscaled is used although masses or late temperatures differ."""
    for run in runs:
        if np.ptp(run.mass) > 0:
            raise RunError(
                f"{run.path}: its disks have several masses; mixture.py draws unscaled speeds of "
                "each species"
            )
        if state not in (EQUILIBRIUM, STEADY):
            raise RunError(f"{run.path}: its kT is not steady, which --unscaled requires")


def common_state(runs: list[Run]) -> str:
    """Return the state of the runs; raise RunError if they differ in kind."""
    state, *others = map(state_of, runs)
    for run, other in zip(runs[1:], others, strict=True):
        if other != state:
            raise RunError(f"{run.path}: differs in kind from {runs[0].path}: draw them separately")
    return state


def unequal_places(runs: list[Run], picked: list[list[int]]) -> list[str]:
    """Return a warning if kT varies in space between walls that heat or cool the disks."""
    factors = [1.0]
    for run, frames in zip(runs, picked, strict=True):
        for axis in np.flatnonzero(~run.periodic) if "open" not in run.nature else ():
            kt = kt_in_strips(run, frames, int(axis), STRIPS)
            if np.nanmin(kt, initial=np.inf) > 0 and np.isfinite(kt).any():
                factors.append(float(np.nanmax(kt) / np.nanmin(kt)))
    if max(factors) < UNEQUAL:
        return []
    return [
        f"kT varies in space by a factor of {max(factors):.2g}: these are the speeds of disks at "
        "different temperatures; see fields.py"
    ]


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Compare the speeds of each species in late frames with the Maxwell distribution."""
    runs = [run for group in groups for run in group.runs]
    state, warnings = common_state(runs), []
    for group in groups:
        refuse_others(group.runs)
        group.values = [late_frames(run, options, warnings) for run in group.runs]
        if state == STEADY:
            warnings += unequal_places(group.runs, group.values)
    found = [temperature(group.runs, group.values) for group in groups]
    if state in (EQUILIBRIUM, STEADY) and any(drift for *_, drift in found):
        state = UNSTEADY
    data: dict[str, Any] = {"u_low": BINS[:-1], "u_high": BINS[1:]}
    warnings += motion_notes(runs)
    for group in groups:
        names = group.runs[0].names
        group.values = [pooled(group.runs, group.values, state, name) for name in names]
        for density, row in group.values:
            end = "_".join(filter(None, (f"N{row['N']}", row.get("species"))))
            data[f"density_{end}"], data[f"density_error_{end}"] = density
            if state in (COOLING, UNSTEADY):
                why = "loses energy, no equilibrium" if state == COOLING else "has no steady kT yet"
                warnings.append(f"{name_of(row)}: {why}; {cooling(row)}")
    data["maxwell"] = np.diff(maxwell_cdf(BINS)) / np.diff(BINS)
    if options.unscaled:
        check_unscaled(runs, state)
    rows = [row for group in groups for _, row in group.values]
    if len(rows) > len(groups):  # the first colours are those of the species
        for group, colour in zip(groups, colours(len(groups), len(rows)), strict=True):
            group.colour = colour
    several = OVER_RUNS * any(len(group.runs) > 1 for group in groups)
    notes = [*(told(row, state) for row in rows), f"{BARS}{several}.", ABOUT_A2, ABOUT_BAND]
    return Result(rows, notes=notes, warnings=warnings, data=data, values=state)


ANALYSIS = Analysis(
    compute,
    draw,
    options=(shared("frames"), shared("equilibration"), shared("min_separation", 5.0), UNSCALED),
    group_by=by_number,
)
