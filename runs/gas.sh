#!/usr/bin/env bash

# Exam, problem 2: speed distributions of 1000 and 2000 disks relaxing from equal speeds to the Maxwell distribution; four seeds
# each.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

# Frames at every half collision per disk resolve the relaxation. The histogram uses the speeds in every tenth frame.
for count in 1000 2000; do
  runs/ensemble.sh input/gas.nml -d "$data" --scan "species.gas.count=$count" --seeds 1-4 \
    --set stop.collisions_per_disk=65 --set "output.frames_every_collisions=$((count / 4))" \
    --set "output.observables_every_collisions=$((count / 4))" "$@"
done
"$python" post/speeds.py "$data"/*.h5 -o "$figures/gas.png" --csv "$figures/gas.csv"
"$python" post/snapshot.py "$data/gas.count_1000_seed_1.h5" --frames 0,-1 --colour speed \
  -o "$figures/gas_frames.png"

# The film shows the start of a run: within a few collisions per disk the speeds approach the Maxwell distribution.
runs/ensemble.sh input/gas.nml -d "$data/film" --seeds 1 --set stop.collisions_per_disk=8 \
  --set output.frames_every_time=0.002 --set output.event_log=.true. "$@"
"$python" post/animate.py "$data/film/seed_1.h5" --colour speed -o "$figures/gas_film"
"$python" post/player.py "$data/film/seed_1.h5" -o "$figures/gas_film.html"
