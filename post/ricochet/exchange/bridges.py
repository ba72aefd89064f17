"""Exchange of data with other programs: MDAnalysis, GSD files and LAMMPS dump files.

For pandas and xarray see the methods `Run.to_dataframe` and `Run.to_xarray`.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from ..reading.arrays import Index, chosen
from ..reading.files import RunError, counted, destination, optional_package
from ..reading.nature import Refused
from ..reading.reader import Run
from .foreign import DAMAGE, check_counts, check_index, check_values

if TYPE_CHECKING:
    import MDAnalysis

__all__ = [
    "ImportedFrame",
    "mdanalysis_universe",
    "read_gsd",
    "read_lammps",
    "write_gsd",
    "write_lammps",
]

TOLERANCE = 1e-6  # largest |z| in a two-dimensional system, relative to the longest edge of the box
CLOSED = "ff"  # keyword of a LAMMPS dump for an axis bounded by walls
#: Columns of a LAMMPS dump that are named differently in Ricochet.
NAMES = {"angular_velocity": "omegaz"}
#: Items of a LAMMPS dump file that have further words on their first line.
ITEMS = ("ATOMS", "BOX BOUNDS")
#: Numeric columns of a LAMMPS dump that are read.
NUMBERS = {f"{axis}{end}" for axis in "xyz" for end in ("", "u", "s", "su")}
NUMBERS |= {"vx", "vy", "radius", "diameter", "mass", "omegaz", "orientation"}
#: The items of a frame: the remaining words of the first line, and the words of the other lines.
Items = dict[str, tuple[list[str], list[list[str]]]]


def mdanalysis_universe(run: Run) -> "MDAnalysis.Universe":
    """Convert a run to a `Universe` of the package MDAnalysis, which must be installed.

    All disks have z = 0; lengths and times keep their values. The type of an atom is the name of
    its species. MDAnalysis assumes equally spaced frames, so the interval is set to the mean.

    Parameters
    ----------
    run : ricochet.Run
        the run to convert

    Returns
    -------
    MDAnalysis.Universe
        all frames, in memory

    Examples
    --------
    >>> universe = ricochet.mdanalysis_universe(run) if has_mdanalysis else None
    >>> universe is None or len(universe.trajectory) == run.n_frames
    True
    """
    import MDAnalysis

    universe = MDAnalysis.Universe.empty(run.n_disks, trajectory=True, velocities=True)
    flat = [np.pad(a[:], ((0, 0), (0, 0), (0, 1))) for a in (run.position, run.velocity)]
    step = (run.time[-1] - run.time[0]) / (run.n_frames - 1) if run.n_frames > 1 else 1.0
    universe.load_new(flat[0], velocities=flat[1], order="fac", dt=step)
    universe.add_TopologyAttr("masses", run.mass)
    universe.add_TopologyAttr("radii", run.radius)
    universe.add_TopologyAttr("types", [run.names[s - 1] for s in run.species])
    return universe


class ImportedFrame(NamedTuple):
    """State of disks at one time, read from a file of another program.

    `disks` holds keyword arguments for `ricochet.write_start`: "position" and "velocity" (N, 2);
    "radius", "mass", "angular_velocity" and "orientation" (N,), as far as the file contains them;
    and "species", the names (N,).
    """

    time: float
    lower: np.ndarray  # (2,) lower left corner of the box
    upper: np.ndarray  # (2,) upper right corner of the box
    periodic: np.ndarray  # (2,) bool
    disks: dict[str, np.ndarray]

    def input(self) -> dict[str, Any]:
        """Return the input groups "box" and "species", to which further groups can be added.

        Returns
        -------
        dict
            groups for `ricochet.run` and `ricochet.Simulation`

        Examples
        --------
        >>> path = ricochet.bridges.write_lammps(run, folder / "gas.lammpstrj")
        >>> gas = ricochet.bridges.read_lammps(path).input()
        >>> with ricochet.Simulation(gas) as box:
        ...     box.n_disks == run.n_disks, box.advance(events=10).events
        (True, 10)
        """
        boundary = ["periodic" if axis else "wall" for axis in self.periodic]
        box = {"lower": self.lower.tolist(), "upper": self.upper.tolist(), "boundary": boundary}
        kinds, groups = self.disks["species"], []
        for kind in dict.fromkeys(kinds.tolist()):
            own = {key: values[kinds == kind] for key, values in self.disks.items()}
            own["name"] = kind if kind[:1].isalpha() else f"type{kind}"
            groups.append({key: value for key, value in own.items() if key != "species"})
        return {"box": box, "species": groups}


def refuse_sheared(run: Run, kind: str) -> None:
    """Raise Refused if the box of a run is sheared."""
    if run.shear_rate:
        why = "the copies of a sheared box are displaced, and"
        raise Refused(f"{run.path}: {why} {kind} files are written of rectangular boxes only")


# --- GSD ---


def write_gsd(
    run: Run, path: str | Path, frames: Index | None = None, precision: str = "double"
) -> Path:
    """Write frames to a GSD file in the schema of HOOMD-blue; the package gsd must be installed.

    The file can be read by freud, OVITO and HOOMD-blue. In this format the origin is at the centre
    of the box, the edges of the box are stored in single precision, and there are no walls. The
    quantities "ricochet/time", "ricochet/lower", "ricochet/upper" and "ricochet/periodic" are
    logged as well.

    Parameters
    ----------
    run : ricochet.Run
        the run to convert
    path : str or Path
        the file to write
    frames : int, slice or list of int, optional
        frames of the run, whose indices become the time steps [all]
    precision : {"double", "single"}
        precision of real numbers; in single precision disks that nearly touch may overlap

    Returns
    -------
    Path
        path of the file

    Raises
    ------
    ImportError
        if gsd is not installed
    Refused
        if the box of the run is sheared

    Examples
    --------
    >>> path = ricochet.bridges.write_gsd(run, folder / "gas.gsd") if has_gsd else None
    >>> path is None or bool(ricochet.bridges.read_gsd(path).time == run.time[-1])
    True
    """
    package, path = optional_package("gsd.hoomd", "write_gsd"), destination(Path(path))
    refuse_sheared(run, "GSD")
    if precision not in ("double", "single"):
        raise ValueError(f"precision: {precision!r} is neither 'double' nor 'single'")
    with package.open(str(path), "w", precision=precision) as file:
        for frame in range(run.n_frames) if frames is None else chosen(run.n_frames, frames):
            file.append(gsd_frame(package, run, frame))
    return path


def gsd_frame(package: Any, run: Run, frame: int) -> Any:
    """Convert a frame of a run to a frame of the package gsd."""
    lower, upper = run.corners_at(run.time[frame])
    found, disks, inside = package.Frame(), run[frame], run.in_box(frame)
    found.configuration.step, found.configuration.dimensions = frame, 2
    found.configuration.box = [*(upper - lower), 0, 0, 0, 0]
    particles = found.particles
    particles.N, particles.types = len(inside), [*run.names]
    particles.typeid = run.species[inside] - 1
    particles.position = in_space(disks.position[inside] - (lower + upper) / 2)
    particles.velocity = in_space(disks.velocity[inside])
    particles.mass, particles.diameter = run.mass[inside], 2 * run.radius[inside]
    if run.image is not None:
        particles.image = in_space(run.image[frame][inside]).astype(np.int32)
    for name in run.disk_data:
        found.log[f"particles/{name}"] = disks.per_disk(name)[inside]
    found.log["ricochet/time"] = np.array([run.time[frame]])
    found.log["ricochet/lower"], found.log["ricochet/upper"] = lower, upper
    found.log["ricochet/periodic"] = run.periodic.astype(np.uint8)
    return found


def in_space(flat: np.ndarray) -> np.ndarray:
    """Append z = 0 to vectors (N, 2)."""
    return np.pad(flat, ((0, 0), (0, 1)))


def read_gsd(path: str | Path, frame: int = -1) -> ImportedFrame:
    """Read a frame of a GSD file; the package gsd must be installed.

    For a file not written by `write_gsd`, it is assumed that both axes are periodic, that the
    origin is at the centre of the box, and that the time is the time step of the frame. Ricochet
    refuses overlapping disks. If positions were written in single precision, touching disks may
    overlap by rounding errors; in this case multiply the radii by 1 - 1e-6.

    Parameters
    ----------
    path : str or Path
        a GSD file in the schema of HOOMD-blue, in two dimensions
    frame : int
        index of the frame, counted from the end if negative

    Returns
    -------
    ImportedFrame
        the disks and the box

    Raises
    ------
    ImportError
        if gsd is not installed
    RunError
        if the file is damaged, or not a GSD file of disks in a rectangle

    Examples
    --------
    >>> path = ricochet.bridges.write_gsd(run, folder / "all.gsd", [0]) if has_gsd else None
    >>> disks = ricochet.bridges.read_gsd(path).disks if has_gsd else {"radius": run.radius}
    >>> bool(np.all(disks["radius"] == run.radius))
    True
    """
    package, path = optional_package("gsd.hoomd", "read_gsd"), Path(path)
    where = f"{path}: frame {frame}"
    try:
        check_index(path)
        with package.open(str(path), "r") as file, np.errstate(all="ignore"):
            count = len(file)
            if not -count <= frame < count:
                raise RunError(f"{path}: has no frame {frame}; it has {counted(count, 'frame')}")
            check_counts(file.file, path, frame % count)
            return imported_gsd(where, file[frame])
    except FileNotFoundError:
        raise RunError(f"{path}: no such file") from None
    except DAMAGE as problem:
        raise RunError(f"{where} cannot be read ({in_words(problem)})") from None


def in_words(problem: BaseException) -> str:
    """Return the message of an exception on one line, or its type if it has no message."""
    return " ".join(str(problem).split()) or type(problem).__name__


def imported_gsd(where: str, found: Any) -> ImportedFrame:
    """Return the disks in a frame of the package gsd; messages begin with `where`."""
    box, particles, log = found.configuration.box, found.particles, found.log
    width, height, *_, xy, xz, yz = box.tolist()
    if any((xy, xz, yz)):
        raise RunError(f"{where}: its box is tilted; only rectangular boxes can be read")
    edges = np.array([width, height])
    in_plane(where, particles.position[:, 2], edges)
    lower = np.asarray(log.get("ricochet/lower", -edges / 2), dtype=float)
    upper = np.asarray(log.get("ricochet/upper", edges / 2), dtype=float)
    periodic = np.asarray(log.get("ricochet/periodic", (1, 1))).astype(bool)
    (time,) = np.ravel(log.get("ricochet/time", float(found.configuration.step))).tolist()
    types = np.array(particles.types)
    disks = {"position": particles.position[:, :2] + (lower + upper) / 2}
    disks |= {"velocity": particles.velocity[:, :2], "mass": particles.mass}
    disks["radius"] = gsd_diameters(particles) / 2
    own = ("angular_velocity", "orientation")
    disks |= {one: log[f"particles/{one}"] for one in own if f"particles/{one}" in log}
    disks = {name: np.array(values, dtype=float) for name, values in disks.items()}
    return checked(time, lower, upper, periodic, disks | {"species": types[particles.typeid]})


def gsd_diameters(particles: Any) -> np.ndarray:
    """Return the diameters (N,) of the disks, which a file may also list by particle type."""
    shapes = [(one or {}).get("diameter") for one in particles.type_shapes or []]
    if len(shapes) == len(particles.types) and all(shapes):
        return np.array(shapes, dtype=float)[particles.typeid]
    return np.asarray(particles.diameter, dtype=float)


def in_plane(where: str, z: np.ndarray, edges: np.ndarray) -> None:
    """Raise RunError unless all disks have the same z."""
    if not np.all(np.isfinite(z)):
        raise ValueError("z: not all numbers are finite")
    if len(z) and np.ptp(z) > TOLERANCE * np.max(edges):
        raise RunError(f"{where} is three-dimensional: its particles have different z")


def checked(
    time: float,
    lower: np.ndarray,
    upper: np.ndarray,
    periodic: np.ndarray,
    disks: dict[str, np.ndarray],
) -> ImportedFrame:
    """Return a frame with disks wrapped into the box; raise ValueError for impossible values."""
    numbers = {name: values for name, values in disks.items() if name != "species"}
    own = {"time": np.array(time), "lower": lower, "upper": upper, "periodic": periodic}
    check_values(own | numbers)
    position = wrapped(disks["position"], lower, upper - lower, periodic)
    return ImportedFrame(time, lower, upper, periodic, disks | {"position": position})


def wrapped(
    position: np.ndarray, lower: np.ndarray, edges: np.ndarray, periodic: np.ndarray
) -> np.ndarray:
    """Return positions (N, 2), shifted into the box by whole periods along the periodic axes."""
    outside = (position < lower) | (position >= lower + edges)
    inside = lower + (position - lower) % edges
    # the operator % may round up to `edges`
    inside = np.where(inside < lower + edges, inside, lower)
    return np.where(outside & periodic, inside, position)


# --- dump files of LAMMPS ---


def write_lammps(
    run: Run, path: str | Path, frames: Index | None = None, time: bool = True
) -> Path:
    """Write frames to a text file in the format of the LAMMPS command `dump custom`.

    The columns are id, type, element (the name of the species), x, y, z, vx, vy, vz, radius and
    mass, with ix, iy, iz for a periodic box, and omegaz and orientation for disks that can rotate.
    Numbers are written with full precision. The time step of a frame is its index in the run.

    Parameters
    ----------
    run : ricochet.Run
        the run to convert
    path : str or Path
        the file to write
    frames : int, slice or list of int, optional
        frames of the run [all]
    time : bool
        write the item TIME, like `dump_modify time yes`, which MDAnalysis cannot read

    Returns
    -------
    Path
        path of the file

    Raises
    ------
    Refused
        if the box of the run is sheared

    Examples
    --------
    >>> path = ricochet.bridges.write_lammps(run, folder / "gas.dump", slice(0, 10))
    >>> path.read_text().count("ITEM: TIMESTEP")
    10
    """
    refuse_sheared(run, "LAMMPS dump")
    path = destination(Path(path))
    with path.open("w") as file:
        for frame in range(run.n_frames) if frames is None else chosen(run.n_frames, frames):
            file.write(lammps_frame(run, frame, time))
    return path


def lammps_frame(run: Run, frame: int, time: bool) -> str:
    """Return the text of a frame of a run in a LAMMPS dump file."""
    lower, upper = run.corners_at(run.time[frame])
    sides = np.array([[*lower, -0.5], [*upper, 0.5]]).T.tolist()
    disks, inside = run[frame], run.in_box(frame)
    zero, species = [0] * len(inside), run.species[inside]
    names = [run.names[s - 1].replace(" ", "_") for s in species]
    columns: dict[str, list[Any]] = {"id": (inside + 1).tolist()}
    columns |= {"type": species.tolist(), "element": names}
    for head, vectors in (("", disks.position), ("v", disks.velocity)):
        x, y = vectors[inside].T.tolist()
        columns |= {f"{head}x": x, f"{head}y": y, f"{head}z": zero}
    columns |= {"radius": run.radius[inside].tolist(), "mass": run.mass[inside].tolist()}
    for name in run.disk_data:
        columns[NAMES.get(name, name)] = disks.per_disk(name)[inside].tolist()
    if run.image is not None:
        x, y = run.image[frame][inside].T.tolist()
        columns |= {"ix": x, "iy": y, "iz": zero}
    lines = ["ITEM: TIME", str(float(run.time[frame]))] if time else []
    lines += ["ITEM: TIMESTEP", str(frame), "ITEM: NUMBER OF ATOMS", str(len(inside))]
    kinds = ["pp" if axis else CLOSED for axis in run.periodic]
    lines += [" ".join(["ITEM: BOX BOUNDS", *kinds, "pp"]), *(f"{a} {b}" for a, b in sides)]
    lines.append(" ".join(["ITEM: ATOMS", *columns]))
    lines += [" ".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    return "\n".join([*lines, ""])


def read_lammps(path: str | Path, frame: int = -1) -> ImportedFrame:
    """Read a frame of a text file written by the LAMMPS command `dump`.

    Positions must be given as x and y, as xu and yu (unwrapped) or as xs and ys (scaled). Optional
    columns are id, element or type (the name of the species), vx, vy, radius or diameter, mass,
    omegaz and orientation. The time is read from the item TIME or, if this is missing, equals the
    time step.

    Parameters
    ----------
    path : str or Path
        the dump file
    frame : int
        index of the frame, counted from the end if negative

    Returns
    -------
    ImportedFrame
        the disks and the box

    Raises
    ------
    RunError
        if the file is damaged or not a dump file, or if its particles are not in a rectangle

    Examples
    --------
    >>> path = ricochet.bridges.write_lammps(run, folder / "last.dump", [-1])
    >>> frame = ricochet.bridges.read_lammps(path)
    >>> bool(np.all(frame.disks["position"] == run.position[-1]))
    True
    >>> ricochet.write_start(folder / "bed.txt", **frame.disks).name
    'bed.txt'
    """
    path = Path(path)
    where = f"{path}: frame {frame}"
    try:
        with path.open("rb") as file, np.errstate(all="ignore"):
            starts = [*frame_starts(file)]
            if not -len(starts) <= frame < len(starts):
                count = f"it has {counted(len(starts), 'frame')}"
                count = count if starts else "it is no dump file of LAMMPS"
                raise RunError(f"{path}: has no frame {frame}; {count}")
            file.seek(starts[frame])
            return imported(where, items_of(file))
    except FileNotFoundError:
        raise RunError(f"{path}: no such file") from None
    except OSError as problem:
        raise RunError(f"{path}: {problem.strerror}") from None
    except KeyError as problem:
        raise RunError(f"{where} has no ITEM: {problem.args[0]}") from None
    except DAMAGE as problem:
        raise RunError(f"{where} is damaged ({in_words(problem)})") from None


def frame_starts(file: BinaryIO) -> Iterator[int]:
    """Yield the positions in a dump file, in bytes, at which frames begin.

    A frame begins with its time step, or with the units and the time that precede it.
    """
    place, before = 0, False
    while line := file.readline():
        if line.startswith(b"ITEM:"):
            first = line.startswith((b"ITEM: UNITS", b"ITEM: TIME"))
            if first and not before:
                yield place
            before = first
        place = file.tell()


def items_of(file: BinaryIO) -> Items:
    """Read the items of one frame from the current position in an open dump file."""
    items: Items = {}
    for line in map(bytes.decode, file):
        if not line.startswith("ITEM:"):
            next(reversed(items.values()))[1].append(line.split())
        elif "ATOMS" in items:
            break
        else:
            name = next((one for one in ITEMS if line[6:].startswith(one)), line[6:].strip())
            items[name] = line[6 + len(name) :].split(), []
    return items


def imported(where: str, items: Items) -> ImportedFrame:
    """Return the disks in a frame of a dump file; messages begin with `where`."""
    kinds, bounds = items["BOX BOUNDS"]
    if len(kinds) != 3:
        raise RunError(f"{where}: its box is tilted; only rectangular boxes can be read")
    lower, upper = np.array(bounds[:2], dtype=float).T
    periodic = np.array([kind == "pp" for kind in kinds[:2]])
    columns, rows = items["ATOMS"]
    count = int(items["NUMBER OF ATOMS"][1][0][0])
    if len(rows) != count or any(len(row) != len(columns) for row in rows):
        whole = f"{count} lines of {len(columns)} columns"
        raise RunError(f"{where} is cut short: it does not consist of {whole}")
    if "id" in columns:
        rows.sort(key=lambda row: int(row[columns.index("id")]))
    text = dict(zip(columns, np.array(rows).reshape(-1, len(columns)).T, strict=True))
    numbers = {name: text[name].astype(float) for name in NUMBERS & text.keys()}
    in_plane(
        where,
        next((numbers[z] for z in ("z", "zu", "zs") if z in numbers), lower[:0]),
        upper - lower,
    )
    vectors = {
        way: np.column_stack([numbers[way.format(axis)] for axis in "xy"])
        for way in ("{}", "{}u", "{}s", "{}su", "v{}")
        if {way.format(axis) for axis in "xy"} <= numbers.keys()
    }
    places = [vectors[way] for way in ("{}", "{}u") if way in vectors]
    places += [lower + vectors[way] * (upper - lower) for way in ("{}s", "{}su") if way in vectors]
    if not places:
        raise RunError(f"{where} has no columns x and y (or xu and yu, or xs and ys)")
    disks = {"position": places[0]}
    disks |= {"velocity": vectors["v{}"]} if "v{}" in vectors else {}
    disks |= {"radius": numbers["diameter"] / 2} if "diameter" in numbers else {}
    disks |= {name: numbers[name] for name in ("radius", "mass", "orientation") if name in numbers}
    disks |= {"angular_velocity": numbers["omegaz"]} if "omegaz" in numbers else {}
    kind = next((text[name] for name in ("element", "type") if name in text), None)
    disks["species"] = np.full(count, "disks") if kind is None else kind
    time = items["TIME" if "TIME" in items else "TIMESTEP"][1][0][0]
    return checked(float(time), lower, upper, periodic, disks)
