#!/usr/bin/env bash

# Lab, task 4, on circular walls and unequal disks: paths in the Sinai and Lorentz billiards, divergence of paths that start close
# together, a round container, and Brownian motion.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

for name in sinai lorentz container; do
  runs/ensemble.sh "input/$name.nml" -d "$data/$name" --seeds 1 --set output.event_log=.true. "$@"
done

# Sinai billiard: 64 initial states, each in two runs whose initial positions differ by 1e-12.
mkdir -p "$data/sinai_pairs"
for k in {1..64}; do
  for shift in 0 1e-12; do
    printf 'pair_%02d_%s\t' "$k" "$shift"
    awk -v k="$k" -v shift="$shift" 'BEGIN {
      set = " --set species.disk."
      x = 0.02 + 0.2 * (0.618 * k % 1) + shift
      y = 0.02 + 0.96 * (0.755 * k % 1)
      printf "%sposition=%.17g,%.17g", set, x, y
      printf "%svelocity=%.17g,%.17g", set, cos(2.4 * k), sin(2.4 * k)
    }'
    printf ' --set %s' stop.time=60 output.frames_every_time=0.1 stop.events=1000000
    printf '\n'
  done
done | replace "$data/sinai_pairs/members.txt"
runs/ensemble.sh input/sinai.nml -d "$data/sinai_pairs" \
  --manifest "$data/sinai_pairs/members.txt" "$@"
runs/ensemble.sh input/brownian.nml -d "$data/brownian" --seeds 1 --set stop.time=10 "$@"
"$python" post/trajectory.py "$data"/{sinai,lorentz}/seed_1.h5 --frames :200 \
  -o "$figures/billiards.png"
"$python" post/lyapunov.py "$data"/sinai_pairs/pair_*.h5 -o "$figures/lyapunov.png" \
  --csv "$figures/lyapunov.csv"
"$python" post/snapshot.py "$data/container/seed_1.h5" --frames 0,-1 --quiver \
  -o "$figures/container.png"
"$python" post/trajectory.py "$data/brownian/seed_1.h5" --disks 2001 -o "$figures/brownian.png"
"$python" post/animate.py "$data/container/seed_1.h5" -o "$figures/container_film"
"$python" post/player.py "$data/container/seed_1.h5" --colour speed -o "$figures/container_film.html"
