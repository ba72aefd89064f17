#!/usr/bin/env bash
# L3: circular walls and unequal disks: paths in three billiards, a round container, Brownian motion.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-.venv/bin/python}
data=runs/billiards figures=runs/figures

for name in sinai lorentz container; do
  runs/ensemble.sh "input/$name.nml" -d "$data/$name" --seeds 1 "$@"
done
runs/ensemble.sh input/brownian.nml -d "$data/brownian" --seeds 1 --set stop.time=10 "$@"
"$python" post/trajectory.py "$data"/{sinai,lorentz}/seed_1.h5 --first 200 \
  -o "$figures/billiards.png"
"$python" post/snapshot.py "$data/container/seed_1.h5" --frames 0,-1 --quiver \
  -o "$figures/container.png"
"$python" post/trajectory.py "$data/brownian/seed_1.h5" --disks 2001 -o "$figures/brownian.png"
"$python" post/animate.py "$data/container/seed_1.h5" -o "$figures/container_film"
