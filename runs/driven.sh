#!/usr/bin/env bash

# Gases heated or sheared by walls, rough disks, transport coefficients in equilibrium, and driven disks: Leidenfrost effect,
# Maxwell's demon, Brazil nut effect, compression by a piston, white-noise driving and active disks. Four seeds each.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

for system in fourier couette rough; do
  runs/ensemble.sh "input/$system.nml" -d "$data/$system" --seeds 1-4 "$@"
done
"$python" post/fields.py "$data"/fourier/*.h5 --across x \
  -o "$figures/fourier.png" --csv "$figures/fourier.csv"
"$python" post/fields.py "$data"/couette/*.h5 --across y \
  -o "$figures/couette.png" --csv "$figures/couette.csv"
"$python" post/rough.py "$data"/rough/*.h5 -o "$figures/rough.png" --csv "$figures/rough.csv"

# At each packing fraction, frames are several mean free times apart, for viscosity, conductivity and diffusion.
transport=()
while read -r packing interval samples placement; do
  runs/ensemble.sh input/bulk.nml -d "$data/transport_$packing" --seeds 1-4 \
    --set "species.disks.packing_fraction=$packing" --set "species.disks.placement=$placement" \
    --set species.disks.count=256 --set stop.collisions_per_disk=8000 \
    --set "output.frames_every_time=$interval" --set output.precision=single \
    --set output.helfand=true --set "output.observables_every_time=$samples" "$@"
  transport+=("$data/transport_$packing"/*.h5)
done <<'TABLE'
0.05 0.13 0.016 random
0.2 0.05 0.006 random
0.35 0.026 0.0033 random
0.5 0.014 0.0018 random
0.6 0.009 0.0011 dense
TABLE
"$python" post/transport.py "${transport[@]}" -o "$figures/transport.png" \
  --csv "$figures/transport.csv"

# Columns: system, quantity on the vertical axis, run for the film, and the options of ensemble.sh that define the runs.
while read -r system show film scan; do
  runs/ensemble.sh "input/$system.nml" -d "$data/$system" --seeds 1-4 ${scan:+--scan "$scan"} "$@"
  "$python" post/driven.py "$data/$system"/*.h5 --show "$show" -o "$figures/$system.png" \
    --csv "$figures/$system.csv"
  "$python" post/player.py "$data/$system/$film.h5" -o "$figures/$system.html"
done <<'TABLE'
leidenfrost height side.bottom.period_0.3_seed_1 side.bottom.period=0.3,2
demon share side.bottom.velocity_0.5_seed_1 side.bottom.velocity=0.5,0.9
nut height seed_1
compression temperature seed_1
constant_pressure width seed_1
heated temperature restitution_0.8_seed_1 contact.restitution=0.8,0.9
active cluster self_propulsion_speed_1_seed_1 drive.self_propulsion_speed=1,0
TABLE
"$python" post/fields.py "$data"/leidenfrost/side.bottom.period_0.3_*.h5 --across y \
  -o "$figures/leidenfrost_fields.png" --csv "$figures/leidenfrost_fields.csv"
