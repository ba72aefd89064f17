#!/usr/bin/env bash

# A sequence of runs, each starting from the last frame of the previous one: compression in two steps, relaxation, cooling, heating
# and expansion.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

stage() { # arguments: name, name of the previous run, further options of ensemble.sh
  local name=$1 before=$2
  shift 2
  runs/ensemble.sh input/bulk.nml -d "$data/$name" --seeds 1 --set species.disks.temperature= \
    --set "species.disks.file=$data/$before/seed_1.h5" "$@"
}

runs/ensemble.sh input/bulk.nml -d "$data/start" --seeds 1 --set species.disks.packing_fraction=0.5 \
  --set stop.collisions_per_disk=50 "$@"
stage dense start --set species.disks.placement=grown --set species.disks.packing_fraction=0.6 \
  --set stop.collisions_per_disk=50 "$@"
stage denser dense --set species.disks.placement=grown --set species.disks.packing_fraction=0.68 \
  --set stop.collisions_per_disk=50 "$@"
stage relaxed denser --set species.disks.packing_fraction=0.68 "$@"
stage cooled relaxed --set species.disks.packing_fraction=0.68 --set contact.restitution=0.9 \
  --set stop.energy_fraction=0.1 "$@"
stage heated cooled --set species.disks.packing_fraction=0.68 --set species.disks.exact_temperature=1 "$@"
stage expanded heated --set box.upper=1.2,1.2 --set species.disks.scale_positions=.true. \
  --set species.disks.packing_fraction=0.47 "$@"
"$python" post/rates.py "$data/relaxed/seed_1.h5" -o "$figures/stages.png" --csv "$figures/stages.csv"
for name in start denser cooled expanded; do
  "$python" post/snapshot.py "$data/$name/seed_1.h5" --colour speed -o "$figures/stages_$name.png"
done
