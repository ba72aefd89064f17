#!/usr/bin/env bash

# Lab, task 3: time per collision as a function of the number of disks, for the three methods of finding the next event. Runs are
# executed one by one, because simultaneous runs would affect each other's times. To repeat the measurement, remove the folder
# runs/cost.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

# The packing fraction is 0.3, and no output is written during a run. Runs have 10 collisions per disk (5 for a million disks),
# enough to make the cost of the first predictions negligible. `rescan` predicts the events of all disks after each collision; a
# few hundred collisions in total are enough for this method.
measure() { # columns: collisions, collisions per disk, power of N by which the collisions are divided, search, numbers of disks
  local collisions=$1 per_disk=$2 power=$3 search=$4 count number radius
  shift 4
  for count; do
    number=$(awk -v c="$collisions" -v d="$per_disk" -v p="$power" -v n="$count" \
      'BEGIN { few = c / n^p; if (few < d * n / 2) few = d * n / 2; printf "%d", few }')
    radius=$(awk -v n="$count" 'BEGIN { printf "%.17g", sqrt(0.3 / (atan2(0, -1) * n)) }')
    printf '%s_%s_%s\t--set run.search=%s --set species.gas.count=%s --set species.gas.radius=%s ' \
      "$search" "$count" "$repeat" "$search" "$count" "$radius"
    printf -- '--set %s=%s ' stop.collisions "$number" stop.collisions_per_disk 1e9 \
      output.precision single \
      output.frames_every_collisions "$number" output.observables_every_collisions "$number"
    printf '\n'
  done
}
for repeat in 1 2 3; do # other processes can only slow a run down, so the fastest of three runs counts
  measure 200000000 0 2 rescan 16 32 64 128 256 512 1024
  measure 100000000 10 1 pairs 16 32 64 128 256 512 1024 2048 4096 8192
  measure 1000000 10 0 cells 16 32 64 128 256 512 1024 2048 4096 8192 16384 65536 262144
  measure 1000000 5 0 cells 1048576
done | replace "$data/members.txt"

runs/ensemble.sh input/gas.nml -d "$data" --manifest "$data/members.txt" "$@" -j 1
"$python" post/cost.py "$data"/*.h5 -o "$figures/cost.png" --csv "$figures/cost.csv"
