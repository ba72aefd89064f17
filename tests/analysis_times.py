"""Measure the processor times of an analysis for reading, computing and drawing.

    python tests/analysis_times.py speeds runs/gas/*.h5
    python tests/analysis_times.py driven runs/heated.h5 show=share

Arguments with `=` are options of the analysis. Frames are read on demand; the time spent in
functions of h5py counts as reading. The figure is drawn for 16 cm and written as a PNG file in
memory. The times are printed in seconds, as a row of a Markdown table.
"""

import io
import sys
from functools import wraps
from time import process_time

import h5py
import matplotlib

import ricochet
from ricochet import read_run

READING = [0.0]  # time in functions of h5py [s]


def timed(method):
    """Return a method whose processor time is added to `READING`."""

    @wraps(method)
    def measured(*words, **more):
        start = process_time()
        try:
            return method(*words, **more)
        finally:
            READING[0] += process_time() - start

    return measured


def main() -> None:
    """Analyse the runs, and print the three times."""
    matplotlib.use("Agg")
    name, *words = sys.argv[1:]
    options = dict(word.split("=", 1) for word in words if "=" in word)
    paths = [word for word in words if "=" not in word]
    for method in ("__getitem__", "read_direct"):
        setattr(h5py.Dataset, method, timed(getattr(h5py.Dataset, method)))
    start = process_time()
    runs = [read_run(path) for path in paths]
    opened, READING[0] = process_time() - start, 0.0
    start = process_time()
    result = ricochet.analyse(name, runs, **options)
    computed = process_time() - start
    read, READING[0] = READING[0], 0.0
    start = process_time()
    figure = result.figure()
    if figure is not None:
        figure.savefig(io.BytesIO(), format="png")
    drawn = process_time() - start
    frames = sum(run.n_frames for run in runs)
    disks = "/".join(sorted({str(run.n_disks) for run in runs}, key=int))
    times = (opened + read + READING[0], computed - read, drawn - READING[0])
    cells = [f"`{name}.py`", len(runs), frames, disks, *(f"{one:.1f}" for one in times)]
    print("|", " | ".join(map(str, cells)), "|", flush=True)


if __name__ == "__main__":
    main()
