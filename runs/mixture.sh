#!/usr/bin/env bash

# Exam, problem 3: speeds and energies of a mixture of light and heavy disks, initially and in equilibrium.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

runs/ensemble.sh input/mixture.nml -d "$data" --seeds 1-8 --set stop.collisions_per_disk=150 "$@"
"$python" post/mixture.py "$data"/*.h5 -o "$figures/mixture.png" --csv "$figures/mixture.csv"
