#!/usr/bin/env bash

# Hard disks in a periodic box: equation of state, time correlations, order, and Haff's law; four seeds each.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

# Initial positions for the pressure: random up to a packing fraction of 0.5, from Lubachevsky-Stillinger compression between 0.5
# and 0.7, and a crystal in a commensurate box from 0.72 on.
runs/ensemble.sh input/bulk.nml -d "$data/fluid" --seeds 1-4 \
  --scan species.disks.packing_fraction=0.05,0.1,0.15,0.2,0.25,0.3,0.35,0.4,0.45,0.5 "$@"
runs/ensemble.sh input/bulk.nml -d "$data/dense" --seeds 1-4 --set species.disks.placement=dense \
  --scan species.disks.packing_fraction=0.55,0.6,0.64,0.68 "$@"
runs/ensemble.sh input/bulk.nml -d "$data/crystal" --seeds 1-4 \
  --set species.disks.placement=lattice --set species.disks.count=960 \
  --set box.upper=1,0.9237604307034013 \
  --scan species.disks.packing_fraction=0.74,0.77,0.8,0.83 "$@"
"$python" post/equation_of_state.py "$data"/{fluid,dense,crystal}/*.h5 \
  -o "$figures/equation_of_state.png" --csv "$figures/equation_of_state.csv"

# For time correlations, frames are about a tenth of the mean free time apart at each packing fraction. All disks start with the
# same speed.
memory=()
while read -r packing interval placement; do
  runs/ensemble.sh input/bulk.nml -d "$data/memory_$packing" --seeds 1-4 \
    --set "species.disks.packing_fraction=$packing" --set "species.disks.placement=$placement" \
    --set "output.frames_every_time=$interval" --set stop.collisions_per_disk=220 \
    --set output.event_log=true \
    --set species.disks.temperature= --set species.disks.speed=1.4142135623730951 "$@"
  memory+=("$data/memory_$packing"/*.h5)
done <<'TABLE'
0.05 0.003 random
0.3 0.0008 random
0.5 0.00035 random
0.68 0.00015 dense
TABLE
"$python" post/correlations.py "${memory[@]}" -o "$figures/correlations.png" \
  --csv "$figures/correlations.csv"
"$python" post/rates.py "$data"/memory_0.3/*.h5 -o "$figures/rates.png" --csv "$figures/rates.csv"

# The theory of a cooling dilute gas applies until flows and clusters develop (shear and clustering instability).
runs/ensemble.sh input/bulk.nml -d "$data/cooling" --seeds 1-8 \
  --set species.disks.packing_fraction=0.02 --set stop.collisions_per_disk=60 \
  --set output.observables_every_collisions=100 --scan contact.restitution=0.95,0.9,0.8 "$@"
"$python" post/haff.py "$data"/cooling/*.h5 -o "$figures/haff.png" --csv "$figures/haff.csv"
