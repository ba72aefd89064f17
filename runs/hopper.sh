#!/usr/bin/env bash

# Discharge rate of a hopper as a function of the width of its outlet, compared with Beverloo's law in two dimensions. The outlet is
# the gap between the lower ends of two walls inclined by 45 degrees; each width is simulated with four seeds. Films and pictures
# show the hopper, a rotating drum, a dragged intruder and a stirrer. Takes about five minutes of processor time.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

# Writes a manifest with a member run for each width and seed. Disks that fall 0.05 below the outlet are recycled to the top.
for width in 0.10 0.12 0.16 0.20 0.24 0.28 0.32 0.36; do
  for seed in 1 2 3 4; do
    awk -v D="$width" -v seed="$seed" 'BEGIN {
      half = D / 2
      printf "width_%s_seed_%d\t--set run.seed=%d", D, seed, seed
      printf " --set wall.left.to=%.17g,%.17g", 0.5 - half, 0.1 + half
      printf " --set wall.right.to=%.17g,%.17g", 0.5 + half, 0.1 + half
      printf " --set drive.from_region=0,1,0,%.17g\n", 0.05 + half
    }'
  done
done | replace "$data/discharge.txt"
runs/ensemble.sh input/hopper.nml -d "$data/discharge" --manifest "$data/discharge.txt" \
  --set stop.time=24 --set output.frames_every_time=6 "$@"
"$python" post/discharge.py "$data"/discharge/*.h5 -o "$figures/discharge.png" \
  --csv "$figures/discharge.csv"
# Makes a film and a picture each of the hopper, a rotating drum, a dragged intruder and a stirrer.
for system in hopper drum intruder stirrer; do
  runs/ensemble.sh "input/$system.nml" -d "$data/$system" --seeds 1 "$@"
  "$python" post/player.py "$data/$system/seed_1.h5" -o "$figures/$system.html"
  "$python" post/snapshot.py "$data/$system/seed_1.h5" --count 4 -o "$figures/$system.png"
done
