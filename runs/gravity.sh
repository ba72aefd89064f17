#!/usr/bin/env bash
# G1-G4: the gravity box: energies, equipartition, exponential laws, pictures and a film.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-.venv/bin/python}
data=runs/gravity figures=runs/figures
mkdir -p "$data" "$figures"

# G1: event driven beside time steps.
runs/ensemble.sh input/gravity.nml -d "$data/events" --seeds 1 "$@"
runs/ensemble.sh input/gravity_steps.nml -d "$data/steps" --scan run.dt=0.004,0.002,0.001 "$@"
"$python" post/energy.py "$data/events/seed_1.h5" "$data"/steps/dt_*.h5 \
  -o "$figures/gravity_energy.png" --csv "$figures/gravity_energy.csv"

# G2: when kinetic energies agree, for four widths of the start velocities, 32 seeds each.
for v0 in 0.1 0.5 1 2; do
  for seed in {1..32}; do
    printf 'v0_%s_seed_%s\t--set species.A.speed=%s --set species.B.speed=%s --set run.seed=%s\n' \
      "$v0" "$seed" "$v0" "$v0" "$seed"
  done
done >"$data/members.txt"
runs/ensemble.sh input/gravity.nml -d "$data/equipartition" --manifest "$data/members.txt" \
  --set stop.time=20 --set output.frames_every_time=20 "$@"
"$python" post/equipartition.py "$data"/equipartition/*.h5 -o "$figures/gravity_equipartition.png" \
  --csv "$figures/gravity_equipartition.csv"

# G3: 500 time units of equilibrium.
runs/ensemble.sh input/gravity.nml -d "$data/long" --seeds 1 --set stop.time=520 "$@"
"$python" post/gravity.py "$data/long/seed_1.h5" --after 20 -o "$figures/gravity_laws.png" \
  --csv "$figures/gravity_laws.csv"

# G4: start, end and ten times between; a film of the first twelve time units.
"$python" post/snapshot.py "$data/events/seed_1.h5" --count 12 --quiver \
  -o "$figures/gravity_frames.png"
"$python" post/animate.py "$data/events/seed_1.h5" --frames 300 -o "$figures/gravity_film"
