#!/usr/bin/env bash
# L2: time per collision against the number of disks for the three ways of finding the next one.
# One run at a time, for the clock's sake; remove runs/cost to measure anew.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-.venv/bin/python}
data=runs/cost figures=runs/figures
mkdir -p "$data" "$figures"

measure() { # search collisions-per-run counts...
  local search=$1 collisions=$2 count
  shift 2
  for count; do
    printf '%s_%s\t--set run.search=%s --set species.gas.count=%s ' \
      "$search" "$count" "$search" "$count"
    printf -- '--set species.gas.packing_fraction=0.3 --set stop.collisions=%s\n' "$collisions"
  done
}
{
  measure rescan 200 64 128 256 512 1024
  measure pairs 20000 64 128 256 512 1024 2048 4096
  measure cells 200000 64 128 256 512 1024 2048 4096 8192 16384 32768 65536
} >"$data/members.txt"

runs/ensemble.sh input/gas.nml -d "$data" --manifest "$data/members.txt" "$@" -j 1
"$python" post/cost.py "$data"/*.h5 -o "$figures/cost.png" --csv "$figures/cost.csv"
