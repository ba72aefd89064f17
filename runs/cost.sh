#!/usr/bin/env bash
# L2: time per collision against the number of disks for the three ways of finding the next one.
# One run at a time, for the clock's sake; remove runs/cost to measure anew.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-.venv/bin/python}
data=runs/cost figures=runs/figures
mkdir -p "$data" "$figures"

# Packing fraction 0.3 whatever the number; no output on the way.
measure() { # search, pairs to look at in a run, power of N that a collision costs, counts
  local search=$1 pairs=$2 power=$3 count collisions radius
  shift 3
  for count; do
    collisions=$((pairs / count ** power))
    radius=$(awk -v n="$count" 'BEGIN { printf "%.17g", sqrt(0.3 / (atan2(0, -1) * n)) }')
    printf '%s_%s\t--set run.search=%s --set species.gas.count=%s --set species.gas.radius=%s ' \
      "$search" "$count" "$search" "$count" "$radius"
    printf -- '--set %s=%s ' stop.collisions "$collisions" \
      output.frames_every_collisions "$collisions" output.observables_every_collisions "$collisions"
    printf '\n'
  done
}
{
  measure rescan 200000000 2 64 128 256 512 1024
  measure pairs 100000000 1 64 128 256 512 1024 2048 4096
  measure cells 1000000 0 64 128 256 512 1024 2048 4096 8192 16384 32768 65536
} >"$data/members.txt"

runs/ensemble.sh input/gas.nml -d "$data" --manifest "$data/members.txt" "$@" -j 1
"$python" post/cost.py "$data"/*.h5 -o "$figures/cost.png" --csv "$figures/cost.csv"
