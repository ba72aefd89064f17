#!/usr/bin/env bash

# Assignment, tasks 1 to 4, on disks in a box under gravity: energies, equipartition, exponential laws, pictures and a film.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"
units=(--units "length=m,time=s,mass=kg,energy=J") # of input/gravity.nml

# Task 1: total energy in event-driven and time-stepped simulations, and the fraction of collisions missed by time-stepped
# simulations.
runs/ensemble.sh input/gravity.nml -d "$data/events" --seeds 1 "$@"
runs/ensemble.sh input/gravity_steps.nml -d "$data/steps" --scan run.dt=0.004,0.002,0.001 "$@"
"$python" post/energy.py "$data/events/seed_1.h5" "$data"/steps/dt_*.h5 "${units[@]}" \
  -o "$figures/gravity_energy.png" --csv "$figures/gravity_energy.csv"
rates=(--seeds 1-32 --set stop.time=520 --set output.frames_every_time=520
  --set output.observables_every_time=20)
runs/ensemble.sh input/gravity.nml -d "$data/rates_events" "${rates[@]}" "$@"
runs/ensemble.sh input/gravity_steps.nml -d "$data/rates_steps" "${rates[@]}" \
  --scan run.dt=0.004,0.002,0.001 "$@"
"$python" post/missed.py "$data"/rates_{events,steps}/*.h5 "${units[@]}" \
  -o "$figures/gravity_missed.png" --csv "$figures/gravity_missed.csv"

# Task 2: time until both species have the same kinetic energy, for four widths of the initial velocity distribution and 100 seeds
# each.
for v0 in 0.1 0.5 1 2; do
  for seed in {1..100}; do
    printf 'v0_%s_seed_%s\t--set species.A.speed=%s --set species.B.speed=%s --set run.seed=%s\n' \
      "$v0" "$seed" "$v0" "$v0" "$seed"
  done
done | replace "$data/members.txt"
runs/ensemble.sh input/gravity.nml -d "$data/equipartition" --manifest "$data/members.txt" \
  --set stop.time=20 --set output.frames_every_time=20 "$@"
"$python" post/equipartition.py "$data"/equipartition/*.h5 "${units[@]}" \
  -o "$figures/gravity_equipartition.png" --csv "$figures/gravity_equipartition.csv"

# Task 3: distributions of speeds and heights in a run of 500 time units in equilibrium.
runs/ensemble.sh input/gravity.nml -d "$data/long" --seeds 1 --set stop.time=520 "$@"
"$python" post/gravity.py "$data/long/seed_1.h5" "${units[@]}" \
  -o "$figures/gravity_laws.png" --csv "$figures/gravity_laws.csv"

# Task 4: pictures at the start, at the end and at ten times in between, close together at the beginning, when the state changes
# fastest; and a film of the first 20 time units, at one time unit per second.
"$python" post/snapshot.py "$data/events/seed_1.h5" --quiver "${units[@]}" \
  --frames 0,10,20,30,50,75,125,250,500,1000,1750,2500 -o "$figures/gravity_frames.png"
runs/ensemble.sh input/gravity.nml -d "$data/film" --seeds 1 --set stop.time=20 \
  --set output.event_log=.true. "$@"
"$python" post/animate.py "$data/film/seed_1.h5" --count 501 -o "$figures/gravity_film"
"$python" post/player.py "$data/film/seed_1.h5" -o "$figures/gravity_film.html"
