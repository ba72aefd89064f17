"""Convert a run to a file for other programs.

    python post/export.py runs/gas.h5 -o gas.xyz     extended XYZ, opens in OVITO as a 2D system
    python post/export.py runs/gas.h5 -o gas.csv     one line per disk and frame, for other programs
    python post/export.py runs/gas.h5 -o gas.gsd     GSD, for HOOMD-blue, freud and OVITO
    python post/export.py runs/gas.h5 -o gas.lammpstrj     a dump file of LAMMPS

The extended XYZ file has full precision.  It contains two coordinates of each disk, its velocity,
radius, mass and further quantities such as the orientation, the box, and the time.

see also
  docs/guides/other-programs.md
"""

import math
from pathlib import Path

from ricochet import Run, RunError
from ricochet.exchange.bridges import write_gsd, write_lammps
from ricochet.reading.files import destination
from ricochet.reports.options import chosen_frames
from ricochet.script import command_line, launch, report

import numpy as np
from tqdm import tqdm

HEAD = "time,id,species,x,y,vx,vy,radius,mass"
PROPERTIES = "species:S:1:pos:R:2:velo:R:2:radius:R:1:mass:R:1"


def rows(run: Run, frame: int) -> list[list[str]]:
    """Return the quantities of each disk in the box as text.

    They are species, x, y, vx, vy, radius and mass, any further quantities in the run, and the id.
    """
    inside = run.in_box(frame)
    species = [run.names[run.species[k] - 1] for k in inside]
    moving = [*run.position[frame].T, *run.velocity[frame].T, run.radius, run.mass]
    arrays = (*moving, *(own[frame] for own in run.disk_data.values()), np.arange(run.n_disks) + 1)
    columns = [one[inside].tolist() for one in arrays]
    return [list(map(str, disk)) for disk in zip(species, *columns, strict=True)]


def xyz_frame(run: Run, frame: int) -> str:
    """Return a frame in extended XYZ format.

    Positions are relative to the lower left corner of the box. The second lattice vector points to
    the image above the box, which is displaced along x in a sheared box.
    """
    (width, height), (x0, y0) = run.edges, run.lower
    tilt = math.remainder(run.shear_rate * height * run.time[frame], width)
    pbc = " ".join("T" if p else "F" for p in (*run.periodic, False))
    properties = ":".join([PROPERTIES, *(f"{name}:R:1" for name in run.disk_data), "id:I:1"])
    head = (
        f'Lattice="{width} 0 0 {tilt} {height} 0 0 0 1" Origin="{x0} {y0} 0" pbc="{pbc}" '
        f"Time={run.time[frame]} Properties={properties}"
    )
    lines = [
        " ".join((species.replace(" ", "_"), *numbers)) for species, *numbers in rows(run, frame)
    ]
    return "\n".join([str(len(lines)), head, *lines, ""])


def csv_frame(run: Run, frame: int) -> str:
    """Return the lines of a frame with comma-separated values."""
    time = str(run.time[frame])
    return "".join(",".join((time, disk[-1], *disk[:-1])) + "\n" for disk in rows(run, frame))


TEXTS = {".xyz": xyz_frame, ".csv": csv_frame}


def write_text(run: Run, path: Path, frames: list[int]) -> None:
    """Write frames to a text file in the format given by the file extension."""
    with destination(path).open("w") as file:
        if path.suffix == ".csv":
            file.write(",".join([HEAD, *run.disk_data]) + "\n")
        for frame in tqdm(frames, unit="frame", desc="export", disable=None):
            file.write(TEXTS[path.suffix](run, frame))


def main() -> None:
    parser = command_line(
        __doc__, "RUN.xyz", one=True, csv=False, open_systems=True, frames=None, count=None
    )
    args = parser.parse_args()
    (run,) = args.runs
    path = args.output or Path(run.path.name).with_suffix(".xyz")
    if path.suffix not in (*TEXTS, ".gsd", ".lammpstrj"):
        raise RunError(f"{path}: an export must end in {', '.join(TEXTS)}, .gsd or .lammpstrj")
    frames = chosen_frames(run, args.frames, args.count)
    try:
        if path.suffix in TEXTS:
            write_text(run, path, frames)
        else:
            (write_gsd if path.suffix == ".gsd" else write_lammps)(run, path, frames)
    except ImportError as problem:
        raise RunError(f"{path}: {problem}") from None
    report(args, None, [{"export": path, "frames": len(frames), "of": run.n_frames}])


if __name__ == "__main__":
    launch(main)
