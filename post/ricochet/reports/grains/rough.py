"""Cooling of rough disks: translational and rotational temperature, compared with theory."""

from types import SimpleNamespace
from typing import Any, NamedTuple

from ...analysis.cooling import Curves, flow_notes, rough, rough_law, steady_ratio
from ...figures.drawing import COLOURS, band, caption, plt
from ...figures.sheet import Panel, Sheet, legend_above
from ...predictions import theory
from ...reading.reader import RunError
from ..groups import Group
from ..registry import Analysis
from ..result import Result
from ..tables import measured, spread

DASHED: dict[str, Any] = {"color": "black", "ls": "--", "lw": 1}


class Rough(NamedTuple):
    """Curves of rough disks with two predictions."""

    curves: Curves
    law: tuple[float, float, float]  # normal and tangential restitution, reduced inertia
    boltzmann: float | None  # temperature ratio from the Boltzmann equation

    def expected(self) -> tuple[Any, Any]:
        """Return the predicted temperatures."""
        start = self.curves["T"].mean[0], self.curves["T_rot"].mean[0]
        return theory.rough_temperatures(self.curves["collisions_per_disk"], start, *self.law)


def draw_temperatures(axes: plt.Axes, result: Result) -> None:
    """Plot the translational and the rotational temperature on a logarithmic axis."""
    found, expected = result.values.curves, result.values.expected()
    tau = found["collisions_per_disk"]
    for k, (name, label) in enumerate((("T", "translational"), ("T_rot", "rotational"))):
        band(axes, tau, *found[name], color=COLOURS[k], label=label)
        axes.plot(tau, expected[k], **DASHED)
    axes.plot([], [], label="Luding et al. 1998", **DASHED)
    top = max(found["T"].mean[0], found["T_rot"].mean[0])
    label = result.runs[0].units.label("temperature", "energy")
    axes.set(yscale="log", ylim=(1e-3 * top, 1.5 * top), ylabel=label)
    axes.set(xlabel="collisions per disk", xlim=(0, None))
    legend_above(axes)


def draw_ratio(axes: plt.Axes, result: Result) -> None:
    """Plot the ratio of the two temperatures."""
    found, (t, t_rot) = result.values.curves, result.values.expected()
    tau, exact = found["collisions_per_disk"], result.values.boltzmann
    band(axes, tau, *found["ratio"], color=COLOURS[2], label="measured")
    axes.plot(tau, t_rot / t, label="Luding et al.", **DASHED)
    if exact is not None:
        axes.axhline(exact, color="black", lw=1, label=f"Boltzmann equation: {exact:.4f}")
    axes.set(ylabel="$T_{rot} / T$", ylim=(0, None), xlabel="collisions per disk", xlim=(0, None))
    legend_above(axes)


def draw(result: Result) -> Sheet:
    """Plot the temperatures and their ratio."""
    left = Panel("temperatures", draw_temperatures, (result,))
    title = f"{caption(result.runs)},  β = {result.values.law[1]:g}"
    return Sheet([[left, Panel("ratio", draw_ratio, (result,))]], title)


def compute(groups: list[Group], options: SimpleNamespace) -> Result:
    """Compare the temperature ratio of rough disks with theory."""
    runs = groups[0].runs
    laws = {rough_law(run) for run in runs}
    if len(laws) > 1:
        raise RunError("the runs differ in their contact law")
    (law,) = laws
    found = rough(runs)
    exact = theory.ROUGH_RATIOS.get(law[:2]) if law[2] == 0.5 else None
    row = dict(zip(("restitution", "tangential_restitution", "inertia"), law, strict=True))
    row |= {"runs": len(runs), **measured("ratio", steady_ratio(runs, law))}
    row |= {"maxwellian": theory.rough_ratio(*law), "boltzmann": exact}
    warnings = flow_notes([("all runs", runs)])
    if exact is None:
        warnings += [
            "the theory assumes Maxwell's velocities; the Boltzmann equation yields up to 6 % less"
        ]
    notes = ["Bands: standard errors of the mean over the runs."]
    values = Rough(found, law, exact)
    data = spread({"": found})
    return Result([row], notes=notes, warnings=warnings, data=data, values=values)


ANALYSIS = Analysis(compute, draw)
