"""Export a run for other programs.

    python post/export.py runs/gas.h5 -o gas.xyz     extended XYZ, opens in OVITO as a 2D system
    python post/export.py runs/gas.h5 -o gas.csv     one line per disk and frame, for anything

Extended XYZ has two position columns, which makes OVITO treat the file as two-dimensional, and
carries velocity, radius, mass, whatever else the disks have (such as their orientation), the box
and the time.  Numbers keep all their digits.
"""

from collections.abc import Iterator
from pathlib import Path

from ricochet import Run, RunError, read_run
from ricochet.files import destination
from ricochet.script import chosen_frames, command_line, launch, report

from tqdm import tqdm

PROPERTIES = "species:S:1:pos:R:2:velo:R:2:radius:R:1:mass:R:1"


def disks(run: Run, frame: int) -> Iterator[tuple]:
    """Species, x, y, vx, vy, radius, mass, and the elements of each disk."""
    return zip(
        (run.names[s - 1] for s in run.species),
        *run.position[frame].T.tolist(),
        *run.velocity[frame].T.tolist(),
        run.radius.tolist(),
        run.mass.tolist(),
        *(own[frame].tolist() for own in run.elements.values()),
        strict=True,
    )


def xyz_frame(run: Run, frame: int) -> str:
    """One frame as extended XYZ; positions from the lower corner as origin of the lattice."""
    (width, height), (x0, y0) = run.edges, run.lower
    pbc = " ".join("T" if p else "F" for p in (*run.periodic, False))
    properties = ":".join([PROPERTIES, *(f"{name}:R:1" for name in run.elements), "id:I:1"])
    head = (
        f'Lattice="{width} 0 0 0 {height} 0 0 0 1" Origin="{x0} {y0} 0" pbc="{pbc}" '
        f"Time={run.time[frame]} Properties={properties}"
    )
    lines = [
        " ".join(map(str, (species.replace(" ", "_"), *numbers, k)))
        for k, (species, *numbers) in enumerate(disks(run, frame), start=1)
    ]
    return "\n".join([str(run.count), head, *lines, ""])


def csv_frame(run: Run, frame: int) -> str:
    """One frame as comma-separated lines."""
    return "".join(
        ",".join(map(str, (run.time[frame], k, *disk))) + "\n"
        for k, disk in enumerate(disks(run, frame), start=1)
    )


def exported(run: Run, suffix: str, frames: list[int]) -> Iterator[str]:
    """The text of the whole file, piece by piece."""
    if suffix == ".csv":
        yield ",".join(["time,id,species,x,y,vx,vy,radius,mass", *run.elements]) + "\n"
    one = csv_frame if suffix == ".csv" else xyz_frame
    for frame in tqdm(frames, unit="frame", desc="export", disable=None):
        yield one(run, frame)


def main() -> None:
    parser = command_line(__doc__, "RUN.xyz", one=True, csv=False, frames=None, count=None)
    args = parser.parse_args()
    run = read_run(args.run)
    path = args.output or Path(run.path.name).with_suffix(".xyz")
    if path.suffix not in (".xyz", ".csv"):
        raise RunError(f"{path}: export ends in .xyz or .csv")
    frames = chosen_frames(run, args.frames, args.count)
    with destination(path).open("w") as file:
        file.writelines(exported(run, path.suffix, frames))
    report(args, [run], "Export", None, [{"export": path, "frames": len(frames), "of": run.frames}])


if __name__ == "__main__":
    launch(main)
