"""Cooling of a gas of inelastic disks, compared with Haff's law."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from ...analysis.cooling import SLOW, Curves, energy_left, exponent, haff, soft_law
from ...analysis.estimates import Estimate, rounded_to_error
from ...analysis.thermodynamics import packing
from ...figures.drawing import band, caption, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions.hard_disks import haff_rate
from ...reading.files import counted
from ...reading.reader import Restitution
from ..groups import Group, by_restitution
from ..registry import Analysis
from ..result import Result
from ..tables import measured, spread

FAR = 3.0  # deviation of a rate from its law that a note reports [standard errors]
RATIO_TOP = 2.0  # largest upper limit of the axis of ratios


class Cooling(NamedTuple):
    """Curves, cooling rate or exponent, and end of the homogeneous state."""

    curves: Curves
    rate: Estimate
    end: float
    until: Estimate

    def shown(self, against: str) -> tuple[np.ndarray, Estimate, np.ndarray, np.ndarray]:
        """Return time or collisions per disk, K, predicted K, and a mask of inhomogeneity."""
        own, tau = self.curves, self.curves["collisions_per_disk"]
        if against == "tau":
            return tau, own["K"], own["law"], tau > self.end
        left_at = np.interp(self.end, tau, own["K"].mean)
        by_time = own["K_by_time"]
        return own["w0_t"], by_time, own["haff"], by_time.mean < left_at


def draw_curves(axes: plt.Axes, result: Result, against: str, ratios: bool) -> None:
    """Plot K, or its ratio to a law, against time ('time') or collisions per disk ('tau')."""
    for group in result.groups:
        x, energy, law, after = group.values.shown(against)
        mean, error = Estimate(energy.mean / law, energy.error / law) if ratios else energy
        band(axes, x, np.where(after, np.nan, mean), error, color=group.colour)
        band(axes, x, np.where(after, mean, np.nan), error, color=group.colour, alpha=0.4)
        if not ratios:
            axes.plot(x, law, color="black", ls="--", lw=1)
    if ratios:
        axes.axhline(1, color="black", ls="--", lw=1, zorder=0)
    axes.set_xlabel("$w_0\\,t$" if against == "time" else "collisions per disk")


def draw_time(axes: plt.Axes, result: Result) -> None:
    """Plot K against time, with Haff's law."""
    draw_curves(axes, result, "time", ratios=False)
    for group in result.groups:
        axes.plot([], [], color=group.colour, label=f"ξ = {group.key:g}")
    axes.plot([], [], color="black", ls="--", lw=1, label=law_of(result, "Haff 1983"))
    floor = min(group.values.curves["K_by_time"].mean.min() for group in result.groups)
    axes.set(xscale="log", yscale="log", ylim=(floor / 2, 1.5), ylabel="$K / K_0$")
    legend_above(axes)


def draw_collisions(axes: plt.Axes, result: Result) -> None:
    """Plot K against collisions per disk, with an exponential law."""
    draw_curves(axes, result, "tau", ratios=False)
    for group in result.groups:
        name, known = expected(group.key, group.values.curves)
        rate = " ± ".join(rounded_to_error(*group.values.rate))
        axes.plot([], [], color=group.colour, label=f"{name} {rate} ({known:.4g})")
    axes.plot(
        [], [], color="black", ls="--", lw=1, label=law_of(result, "van Noije and Ernst 1998")
    )
    axes.set(yscale="log", xlim=(0, None), ylabel="$K / K_0$")
    legend_above(axes)


def draw_ratio(axes: plt.Axes, result: Result, against: str) -> None:
    """Plot the ratio of K to a law."""
    draw_curves(axes, result, against, ratios=True)
    axes.autoscale(axis="y")  # to the curves of both panels that share this axis
    axes.set(ylabel="$K$ / law", ylim=(None, min(RATIO_TOP, axes.get_ylim()[1])))


def law_of(result: Result, constant: str) -> str:
    """Return the name of the law with which K is compared."""
    if all(group.key.law == "constant" for group in result.groups):
        return constant
    return "law for viscoelastic disks and Maxwell's velocities"


def draw(result: Result) -> Sheet:
    """Plot K against time and collisions per disk, with its ratios to both laws below."""
    time = Panel("time", draw_time, (result,), aspect=0.85)
    tau = Panel("collisions", draw_collisions, (result,), aspect=0.85, share_y="time")
    low = Panel("time_ratio", draw_ratio, (result, "time"), aspect=0.45, share_x="time")
    more = {"aspect": 0.45, "share_x": "collisions", "share_y": "time_ratio"}
    right = Panel("collisions_ratio", draw_ratio, (result, "tau"), **more)
    eta = sorted({round(packing(run), 6) for run in result.runs})
    title = f"{caption(result.runs)},  η = {', '.join(f'{value:.3g}' for value in eta)}"
    return Sheet([[time, tau], [low, right]], title)


def energies(groups: list[Group]) -> list[dict[str, Any]]:
    """Return the energies after 5, 10 and 20 collisions per disk, if the runs are long enough."""
    rows = []
    for group in groups:
        found = group.values.curves
        reached = found["collisions_per_disk"]
        for tau in (5, 10, 20):
            if tau <= reached[-1]:
                row = {"restitution": group.key.name, "runs": len(group.runs)}
                row["collisions_per_disk"] = tau
                left = Estimate(*(np.interp(tau, reached, part) for part in found["K"]))
                row |= measured("energy_left", left)
                law = np.interp(tau, reached, np.log(found["law"]))
                rows.append(row | {"expected": float(np.exp(law))})
    return rows


def expected(law: Restitution, found: Curves) -> tuple[str, float]:
    """Return the predicted cooling rate or, for viscoelastic disks, the predicted exponent."""
    if law.law == "constant":
        return "rate", haff_rate(law.xi)
    return "exponent", exponent(found["w0_t"], found["haff"])


def rates(groups: list[Group]) -> list[dict[str, Any]]:
    """Return the measured and predicted cooling rate, and the end of the homogeneous state."""
    rows = []
    for group in groups:
        (name, known), until = expected(group.key, group.values.curves), group.values.until
        row = {"restitution": group.key.name, "runs": len(group.runs)}
        row |= measured(name, group.values.rate) | {"expected": known}
        end = until if np.isfinite(until.error) else None
        rows.append(row | measured("homogeneous_until", end))
    return rows


def apart(xi: Restitution, found: Curves, end: float) -> list[str]:
    """Return a warning if the gas stays homogeneous but its final K deviates from the law."""
    ratio, tau = found["K"].mean[-1] / found["law"][-1], found["collisions_per_disk"][-1]
    if not np.isnan(end) or abs(ratio - 1) < 1 - SLOW:
        return []
    law = f"ξ = {xi:g}: the law is that of a homogeneous gas; here K is {ratio:.3g} of it after "
    return [f"{law}{tau:.3g} collisions per disk"]


def deviation(group: Group) -> list[str]:
    """Return a note if the rate or exponent deviates from its law by more than `FAR` errors."""
    name, known = expected(group.key, group.values.curves)
    mean, error = group.values.rate
    if not error > 0 or abs(mean - known) <= FAR * error:
        return []
    side = "below" if mean < known else "above"
    text = (
        f"ξ = {group.key:g}: {name} {abs(mean - known) / error:.1f} standard errors {side} the law"
    )
    runs = f"from {counted(len(group.runs), 'run')}"
    return [f"{text}, which neglects correlations of velocities ({runs})."]


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Compare energy and cooling rate with Haff's law."""
    for group in groups:
        curves = [energy_left(run) for run in group.runs]
        group.values = Cooling(*haff(curves, group.key.xi, soft_law(group.runs)))
    data = spread({f"_xi{group.key:g}": group.values.curves for group in groups})
    notes = [
        "Bands: standard errors of the mean over the runs. In brackets: cooling rate of the law. "
        "Pale: the gas is no longer homogeneous."
    ]
    notes += [text for group in groups for text in deviation(group)]
    warnings = [
        text for group in groups for text in apart(group.key, group.values.curves, group.values.end)
    ]
    further = [rates(groups)]
    return Result(energies(groups), notes=notes, warnings=warnings, further=further, data=data)


ANALYSIS = Analysis(compute, draw, group_by=by_restitution)
