#!/usr/bin/env bash

# Lab, tasks 1 and 2: 10 x 10 disks that start on a grid; frames, distribution of speeds, and a film. First for equal disks, then
# for disks of different masses.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

runs/ensemble.sh input/lab.nml -d "$data" --seeds 1 "$@"
# Frame 50 shows the state after 5000 events. The 500 frames that follow contain 50 000 speeds in total.
"$python" post/speeds.py "$data/seed_1.h5" --frames 51: --equilibration 0 --min-separation 0 \
  -o "$figures/lab_speeds.png" --csv "$figures/lab_speeds.csv"
runs/ensemble.sh input/lab.nml -d "$data/start" --seeds 1 --set stop.events=300 \
  --set output.frames_every_events=1 "$@"
"$python" post/snapshot.py "$data/start/seed_1.h5" --frames 0,50,100,300 --quiver \
  -o "$figures/lab_frames.png"
"$python" post/animate.py "$data/start/seed_1.h5" -o "$figures/lab_film"
"$python" post/player.py "$data/start/seed_1.h5" -o "$figures/lab_film.html"

# Large heavy disks start in the left half of the box, small light disks in the right half, all with speed 1.
runs/ensemble.sh input/mixture.nml -d "$data/masses" --seeds 1 \
  --set species.light.count=100 --set species.light.grid=10,10 \
  --set species.light.radius=0.01 --set species.light.region=0.5,1,0,1 \
  --set species.heavy.count=16 --set species.heavy.grid=4,4 --set species.heavy.mass=16 \
  --set species.heavy.radius=4 --set species.heavy.region=0,0.5,0,1 \
  --set output.frames_every_collisions=100 "$@"
"$python" post/snapshot.py "$data/masses/seed_1.h5" --frames 0,5,-1 --quiver \
  -o "$figures/lab_masses.png"
"$python" post/mixture.py "$data/masses/seed_1.h5" -o "$figures/lab_masses_speeds.png"
