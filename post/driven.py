"""Quantities of driven disks against time, with pictures of the disks.

    python post/driven.py runs/heated/*.h5 -o heated.png --csv heated.csv
    python post/driven.py runs/demon/*.h5 --show share -o demon.png
    python post/driven.py runs/constant_pressure/*.h5 --show width -o width.png

--show temperature: temperature kT of the velocities relative to the mean velocity u.  For all N
disks, kT = m <(v - u)^2> / 2 times N / (N - 1).  The table also contains the components kT_x and
kT_y, and the temperature of each species.  For equal disks with white-noise driving in a periodic
box, the dashed line is the temperature at which driving and dissipation balance (van Noije and
Ernst 1998).  If one side of the box moves at a constant velocity and the disks are equal and
elastic, the dashed line shows the temperature on the adiabat.  The adiabat follows from the
equation of state, including the layers at the walls (`hard_disks.adiabat`), and applies to slow
compression and expansion.  A comparison with the adiabat requires several runs, because the
temperature of a single run is constant while the side is at rest, and no error can be determined
from a constant temperature.

--show width: width of a box with a piston (motion = 'piston').  For equal elastic disks, the dashed
lines show the predicted mean width and the range of one standard deviation around it.  The
prediction follows from the equation of state at constant enthalpy (docs/explanation/theory.md).
The script also prints the measured standard deviation of the width, and the largest relative
changes of two conserved quantities: the enthalpy, and the total momentum of the disks and the
piston.

--show share: fraction of the disks in the left half of the box.  The dashed lines show predicted
steady fractions for a dilute gas above a vibrating floor, in a box whose two halves are connected
by a hole (after Eggers 1999).  The floor moves with a sawtooth motion.

--show height: mean height of the disks of each species.

--show viscosity: viscosity of a sheared box (box.shear_rate), which is -P_xy divided by the shear
rate.  The component P_xy of the pressure tensor includes the kinetic and the collisional part, and
is averaged over the time between two samples of the observables.  The viscosity is also measured if
the disks are inelastic.

--show cluster: fraction of the disks in the largest cluster.  Two disks belong to the same cluster
if the gap between them is smaller than a tenth of the mean diameter.

The figure contains a curve for each run; the colours denote inputs and species.  Each point is an
average over 1/60 of the duration of the run, or with --show width over 1/1000 of the duration.  The
script prints the mean over the second half of the run with its error, and the ratio of this mean to
the theoretical value.  With --show share, the script prints the mean fraction of the disks in the
half of the box that contains more disks.  To avoid a bias of the mean fraction, the half with more
disks is determined for each frame from another part of the run.  The pictures show the last frame
of the first run of each input.  If all runs have the same input, the pictures show the first and
the last frame.  Very small disks are drawn enlarged.
"""

from collections.abc import Callable
from typing import NamedTuple

from ricochet import Run, RunError, drawing, hard_disks, theory
from ricochet.analysis.statistics import Estimate, combine_runs, correlated_mean, has_trend, windows
from ricochet.analysis.structure import largest_cluster
from ricochet.analysis.thermodynamics import packing
from ricochet.figures.drawing import plt
from ricochet.reading.nature import ROUNDING, Refused
from ricochet.reading.reader import SIDES
from ricochet.script import command_line, launch, measured, over_runs, report

import numpy as np

MOST_PICTURES = 3
POINTS, FINE = 60, 1000  # points of a curve, and of a curve whose fluctuations are of interest
HEIGHT = 4.5  # height of a picture [inch]
GAP = 0.1  # largest gap in a cluster [mean diameters]
SMALLEST = 2.2  # smallest diameter of a drawn disk [points]
Curves = dict[str, tuple[np.ndarray, np.ndarray]]  # time and value by species, '' for all of them


def temperature(run: Run) -> Curves:
    """Return the time series of the temperature relative to the mean velocity."""
    if run.n_disks < 2:
        raise Refused(
            f"{run.path}: holds one disk; a temperature requires at least two, as it is "
            "about their mean velocity"
        )
    time, value = run.observable("all/temperature")
    curves = {"": (time, value * run.n_disks / (run.n_disks - 1))}
    for kind in run.by_species if len(run.names) > 1 else ():
        if (count := int(kind.disks.sum())) > 1:
            time, value = run.observable(f"{kind.name}/temperature")
            curves[kind.name] = time, value * count / (count - 1)
    return curves


def components(run: Run) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the time series of kT_x and kT_y of all disks, relative to their mean velocity."""
    time, tensor = run.observable("kinetic_tensor")
    motion = 0 if run.shear_rate else run.observable("momentum").value ** 2 / run.mass.sum()
    kt = (tensor[:, [0, 3]] - motion) / (run.n_disks - 1)
    return {f"kT_{axis}": (time, kt[:, k]) for k, axis in enumerate("xy")}


def keeps_energy(run: Run) -> bool:
    """Return whether the kinetic energy is constant in the second half of the run."""
    time, energy = run.observable("all/kinetic_energy")
    late = energy[time >= (time[0] + time[-1]) / 2]
    return bool(np.ptp(late) < ROUNDING * np.max(late, initial=0))


def noise_law(run: Run) -> float | None:
    """Return the temperature at which driving balances dissipation."""
    drive = run.parameters.get("drive", {})
    needs = {"noise_driven", "inelastic"}
    known = needs <= run.nature <= needs | {"rotating", "random_walk"}
    if not known or drive.get("species"):
        return None
    gas = packing(run), 2 * run.radius[0], run.mass[0]
    return hard_disks.noise_temperature(float(drive["strength"]), run.restitution, *gas)


def temperature_law(run: Run) -> np.ndarray | float | None:
    """Return the temperature of the steady state, or the temperatures on the adiabat."""
    side = only_moving(run, "constant_velocity")
    if side is None:
        return noise_law(run)
    kt = run.observable("all/temperature").value
    return kt[0] * run.n_disks / (run.n_disks - 1) * adiabat(run, side, widths(run, side))


def only_moving(run: Run, motion: str) -> int | None:
    """Return the index of the moving side of a box of equal elastic disks.

    The result is None unless exactly one side moves.
    """
    moves = [k for k, side in enumerate(run.sides) if side.get("motion", "still") != "still"]
    plain = run.nature <= {"moving_sides", "piston", "walls", "rotating"} and len(moves) == 1
    return moves[0] if plain and run.sides[moves[0]]["motion"] == motion else None


def widths(run: Run, side: int) -> np.ndarray:
    """Return the widths (S,) of the box at the times of the S samples of the observables.

    The width is measured along the direction in which the side moves.
    """
    lower, upper = run.corners_at(run.observable("total_energy").time)
    return (upper - lower)[:, side // 2]


def adiabat(run: Run, side: int, widths: np.ndarray) -> np.ndarray:
    """Return the temperatures on the adiabat, divided by the temperature at the initial width."""
    height, walled = float(run.edges[1 - side // 2]), not run.periodic[1 - side // 2]
    return hard_disks.adiabat(widths, height, run.n_disks, float(run.radius[0]), walled)


def width(run: Run) -> Curves:
    """Return the width of the box along the direction in which its piston moves."""
    if not run.piston_positions:
        raise Refused(f"{run.path}: has no piston (side.motion = 'piston')")
    return {"": (run.observable("total_energy").time, widths(run, min(run.piston_positions)))}


class Room(NamedTuple):
    """Predicted mean and standard deviation of the fluctuating width of a box."""

    mean: float
    deviation: float


def width_law(run: Run) -> Room | None:
    """Return the predicted width of a box at constant enthalpy, for a piston initially at rest."""
    side = only_moving(run, "piston")
    if side is None or not run.sides[side]["force"] > 0:
        return None
    along = bool(run.periodic[1 - side // 2])  # momentum along the sides is conserved
    flow = along * run.observable("momentum").value[0, 1 - side // 2] ** 2 / 2 / run.mass.sum()
    energy = run.observable("all/kinetic_energy").value[0] * run.n_disks - flow
    start, force = widths(run, side)[:1], float(run.sides[side]["force"])
    grid = np.linspace(0, start + energy / force, 20002)[1:-1, 0]
    places = -(run.n_disks - along / 2) * np.log(adiabat(run, side, np.append(start, grid))[1:])
    left = energy + force * (start - grid)
    mean, variance = theory.pushed_width(grid, places, 2 * run.n_disks + 1 - along, left)
    least = grid[np.isnan(places).sum()]
    return Room(mean, variance**0.5) if mean - 4 * variance**0.5 > least else None


def balances(run: Run) -> tuple[float, float]:
    """Return the largest relative changes of the enthalpy and of the total momentum in a run."""
    k = min(run.piston_positions)
    side = run.sides[k]
    time, energy = run.observable("total_energy")
    speed, impulse = (
        run.observable(f"sides/{SIDES[k]}/{what}").value for what in ("velocity", "impulse")
    )
    speed, given = np.ravel(speed), (-1) ** k * impulse[:, k // 2]
    energy = energy + side["mass"] * speed**2 / 2 + side["force"] * widths(run, k)
    momentum = side["mass"] * speed - side["force"] * time - given
    return np.ptp(energy) / energy[0], np.ptp(momentum) / np.abs(given).max()


def share(run: Run) -> Curves:
    """Return the fraction of the disks in the left half of the box in each frame."""
    middle = run.lower[0] + run.edges[0] / 2
    return {"": (run.time, np.mean(run.position[:][..., 0] < middle, axis=1))}


def fuller(share: np.ndarray) -> np.ndarray:
    """Return the fractions (T,) of disks in the half of the box that contains more disks.

    The argument `share` contains the fractions of the disks in the left half of the box.  For
    frames in the first third of the run, the half with more disks is determined from the last
    third, and vice versa.  If the same frames were used both to determine the half with more disks
    and to calculate the mean fraction, chance alone would make the mean fraction larger than 1/2.
    The middle third is not used, because the first and last third must be statistically
    independent.
    """
    third = max(1, len(share) // 3)
    ends = share[:third], share[-third:]
    signs = [np.sign(end.mean() - 0.5) for end in ends]
    return 0.5 + np.concatenate([signs[1] * (ends[0] - 0.5), signs[0] * (ends[1] - 0.5)])


def demon_law(run: Run) -> float | None:
    """Return the predicted steady fraction of disks in the half that contains more disks."""
    floor = run.parameters.get("side", {}).get("bottom", {})
    middle = run.lower[0] + run.edges[0] / 2
    parting = [wall for wall in run.walls if np.allclose(wall[:, 0], middle)]
    heights = [w[:, 1].max() for w in parting if np.isclose(w[:, 1].min(), run.lower[1])]
    across, down = run.gravity
    alike = run.nature <= {"moving_sides", "gravity", "inelastic", "obstacles", "rotating", "walls"}
    if floor.get("motion") != "sawtooth" or not heights or across != 0 or not alike:
        return None
    if run.obstacles or run.restitution == 1 or run.parameter("contact", "wall_restitution") != 1:
        return None
    hole, diameter = float(heights[0] - run.lower[1]), 2 * run.radius[0]
    layers = run.n_disks * diameter / (run.edges[0] / 2 - diameter)
    climb = max(0.0, -down) * hole / float(floor["velocity"]) ** 2
    return theory.demon_share(climb, layers, run.restitution)


def height(run: Run) -> Curves:
    """Return the mean height of each species above the floor in each frame."""
    y = run.position[:][..., 1] - run.lower[1]
    several = len(run.names) > 1
    return {
        kind.name * several: (run.time, y[:, kind.disks].mean(axis=1)) for kind in run.by_species
    }


def cluster(run: Run) -> Curves:
    """Return the fraction of the disks in the largest cluster in each frame."""
    gap = GAP * 2 * float(run.radius.mean())
    shares = [largest_cluster(run, frame, gap) / run.n_disks for frame in range(run.n_frames)]
    return {"": (run.time, np.array(shares))}


def viscosity(run: Run) -> Curves:
    """Return the time series of the viscosity, which is -P_xy divided by the shear rate."""
    if "sheared" not in run.nature:
        raise Refused(f"{run.path}: is not sheared; --show viscosity requires box.shear_rate")
    if "random_walk" in run.nature:
        why = "noise moves its centre of mass through the flow, which changes the stress"
        raise Refused(f"{run.path}: {why}; set drive.keep_momentum = .true.")
    time, first = np.unique(run.observable("kinetic_tensor").time, return_index=True)
    flown, handed = (run.observable(f"{k}_tensor").value[first, 1] for k in ("kinetic", "virial"))
    stress = (flown[1:] + flown[:-1]) / 2 + np.diff(handed) / np.diff(time)
    return {"": (time[1:], -stress / (run.shear_rate * np.prod(run.edges)))}


# For each quantity, `QUANTITIES` contains the text and the unit of the axis label and three
# functions, which return the measured curves, the prediction, and the values whose mean is compared
# with the prediction.
QUANTITIES = {
    "width": (("width of the box", "length"), width, width_law, np.asarray),
    "temperature": (("kT", "energy"), temperature, temperature_law, np.asarray),
    "share": (("share of the disks in the left half", "number"), share, demon_law, fuller),
    "height": (("mean height", "length"), height, lambda run: None, np.asarray),
    "viscosity": (("$-P_{xy}$ / shear rate", "viscosity"), viscosity, lambda run: None, np.asarray),
    "cluster": (
        ("share of the disks in the largest cluster", "number"),
        cluster,
        lambda run: None,
        np.asarray,
    ),
}


def on_average(laws: list) -> np.ndarray | float | Room | None:
    """Return the mean prediction of runs that differ in their seed and their initial energy."""
    rooms = all(isinstance(law, Room) for law in laws)
    return Room(*map(float, np.mean(laws, axis=0))) if rooms else laws[0]


def levels(law: np.ndarray | float | Room | None, compared: Callable) -> list:
    """Return the values of a prediction that the figure shows as horizontal lines."""
    if isinstance(law, Room):
        return [law.mean, law.mean - law.deviation, law.mean + law.deviation]
    return [] if law is None else [law, 1 - law] if compared is fuller else [law]


def by_input(runs: list[Run]) -> dict[str, list[Run]]:
    """Group runs that differ only by their seed.

    The key of each group describes how the group differs from the other groups.
    """
    own = [{"N": run.n_disks, "ξ": run.restitution, **drawing.numbers_of(run)} for run in runs]
    names = [name for name in own[0] if len({numbers.get(name) for numbers in own}) > 1]
    groups: dict[str, list[Run]] = {}
    for run, numbers in zip(runs, own, strict=True):
        label = ", ".join(f"{name} = {numbers[name]:g}" for name in names if name in numbers)
        groups.setdefault(label, []).append(run)
    return groups


def draw_curves(
    axes: plt.Axes, tracks: dict[tuple[str, str], list], laws: dict, fine: bool
) -> None:
    """Draw measured values as solid lines and predictions as dashed lines."""
    for (key, curves), colour in zip(tracks.items(), drawing.colours(len(tracks)), strict=True):
        label = ", ".join(filter(None, key)) or "measured"
        for k, (time, value) in enumerate(curves):
            means = windows(time, value, (time[-1] - time[0]) / (FINE if fine else POINTS))
            style = {"label": label * (k == 0)} | drawing.lone(means[0])
            axes.plot(*means, color=colour, lw=1, alpha=0.4 if fine else 1, **style)
        for level in () if key[1] else laws[key[0]]:
            over = curves[0][0] if np.ndim(level) else np.array([0, curves[0][0][-1]])
            axes.plot(over, np.broadcast_to(level, over.shape), color=colour, ls="--", lw=1.6)
    if any(laws.values()):
        axes.plot([], [], color="black", ls="--", label="theory")
    bottom, top = 0.9 * axes.dataLim.y0 if fine else 0, 1.06 * axes.dataLim.y1
    axes.set(xlim=(0, None), ylim=(bottom, top))
    axes.legend()


def draw(
    groups: dict[str, list[Run]], tracks: dict, laws: dict, label: tuple[str, str], fine: bool
) -> plt.Figure:
    """Draw the curves of a quantity, and below the curves the pictures of the disks."""
    runs = [run for own in groups.values() for run in own]
    pictures = [(own[0], -1, name) for name, own in groups.items()][:MOST_PICTURES]
    if len(groups) == 1:
        pictures = [(runs[0], frame, "") for frame in (0, -1)]
    width = HEIGHT * min(1.0, 1 / drawing.aspect_of(runs[0]))
    figure, (axes, *panels) = plt.subplots(
        1,
        1 + len(pictures),
        figsize=(1.5 * HEIGHT + width * len(pictures) + 1, HEIGHT + 1),
        width_ratios=[1.5 * HEIGHT, *[width] * len(pictures)],
    )
    draw_curves(axes, tracks, laws, fine)
    axes.set(xlabel=runs[0].units.label("time"), ylabel=runs[0].units.label(*label))
    for panel, (run, frame, name) in zip(panels, pictures, strict=True):
        drawing.draw_box(panel, run, run.time[frame])
        shades = drawing.species_colours(run)
        across = 72 * width * 2 * run.radius.mean() / (run.bounds[1] - run.bounds[0])[0]
        rim = {"linewidths": max(0.0, SMALLEST - across), "edgecolors": "face"}
        drawing.disk_collection(panel, run, run.position[frame], facecolors=shades, **rim)
        panel.set_title("\n".join(filter(None, (name, f"t = {run.time[frame]:.4g}"))))
    panels[0].tick_params(labelleft=True)
    panels[0].set_ylabel(runs[0].units.coordinate("y"), labelpad=-8)
    if not any(species for _, species in tracks):  # otherwise the legend shows their colours
        drawing.species_legend(figure, runs[0])
    figure.suptitle(drawing.titled(runs))
    return figure


def main() -> None:
    parser = command_line(__doc__, "driven.png")
    parser.add_argument(
        "--show", choices=QUANTITIES, default="temperature", help="quantity to show [temperature]"
    )
    args = parser.parse_args()
    for run in args.runs:
        if run.n_frames < 2 or not run.time[-1] > run.time[0]:
            raise RunError(f"{run.path}: has one frame, two are required")
    label, curves_of, law_of, compared = QUANTITIES[args.show]
    groups, tracks, rows, notes = by_input(args.runs), {}, [], []
    for name, runs in groups.items():
        for run in runs:
            for species, curve in curves_of(run).items():
                tracks.setdefault((name, species), []).append(curve)
    expected = {name: on_average([law_of(run) for run in runs]) for name, runs in groups.items()}
    for (name, species), curves in tracks.items():
        late = [compared(value[time >= (time[0] + time[-1]) / 2]) for time, value in curves]
        about = ", ".join(filter(None, (args.show, name, species)))
        row = {"input": name or None, "species": species or None, "runs": len(curves)}
        members = [correlated_mean(half) for half in late]
        if (
            args.show == "temperature" and not species
        ):  # fluctuations within one run do not show the scatter over seeds
            own = zip(members, groups[name], strict=True)
            members = [m._replace(error=np.nan) if keeps_energy(run) else m for m, run in own]
        row |= over_runs("late", members, notes, about)
        notes += [f"{about}: still increases or decreases; 'late' is not steady"] * any(
            map(has_trend, late)
        )
        law = None if species else expected[name]
        mean, error = row["late"], row["late_error"]
        known = all("kinetic_tensor" in run.observables for run in groups[name])
        if args.show == "temperature" and not species and known:
            parts = [components(run) for run in groups[name]]
            for part in parts[0]:
                both = [one[part] for one in parts]
                halves = [value[time >= (time[0] + time[-1]) / 2] for time, value in both]
                row |= measured(part, combine_runs(list(map(correlated_mean, halves))))
        if isinstance(law, Room):
            squares = combine_runs([correlated_mean((half - mean) ** 2) for half in late])
            found = Estimate(squares.mean**0.5, squares.error / 2 / squares.mean**0.5)
            row |= measured("deviation", found) | {"theory_deviation": law.deviation}
            changes = np.max([balances(run) for run in groups[name]], axis=0)
            row |= dict(zip(("enthalpy_change", "momentum_change"), changes, strict=True))
            law = law.mean
        if np.ndim(law):
            time = curves[0][0]
            law = float(np.mean(law[time >= (time[0] + time[-1]) / 2]))
        row |= {"theory": law} | measured("ratio", law and Estimate(mean / law, error / law))
        rows.append(row)
    laws = {name: levels(law, compared) for name, law in expected.items()}
    figure = draw(groups, tracks, laws, label, fine=args.show == "width")
    report(args, figure, rows, notes=notes)


if __name__ == "__main__":
    launch(main)
