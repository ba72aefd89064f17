#!/usr/bin/env bash

# Melting of hard disks: pressure against packing fraction, and pictures of the bond-orientational order.
#
# Between the packing fractions 0.70 and 0.72, crystals melt and liquids freeze very slowly. The runs of 64^2 disks therefore start
# from two half-melted crystals, prepared at a packing fraction of 0.66: in one, slightly less than half has melted, in the other
# slightly more. Differing results reveal a dependence on the initial state. The runs of 128^2 disks start from four copies of the
# final states of 64^2 disks, with new velocities. Without FULL=1 the script takes several minutes; P* near melting is then correct
# to 0.1, with warnings where the two initial states give different results. FULL=1 adds longer runs, and runs of 256^2 disks, which
# take 8 to 15 hours of processor time in all (runs/README.md).
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

if [[ -n ${FULL:-} ]]; then
  sides=(64 128 256) length=([64]=500000 [128]=250000 [256]=100000) data=$data/full
  mkdir -p -- "$data"
else
  sides=(64 128) length=([64]=4000 [128]=1500)
fi

disks() { # arguments: number of disks along a side of the square, folder, further options of ensemble.sh
  local upper
  upper=$(awk -v n="$1" 'BEGIN { printf "%.17g,%.17g", n / 64, n / 64 * sqrt(3) / 2 }')
  runs/ensemble.sh input/bulk.nml -d "$data/$2" --set "species.disks.count=$(($1 ** 2))" \
    --set "box.upper=$upper" --set "output.observables_every_collisions=$((5 * $1 ** 2))" "${@:3}"
}

# copy_four_times FOLDER NAME...: writes an initial-configuration file for each run, with 2 x 2 copies of its last frame.
copy_four_times() {
  "$python" - "$@" <<'PYTHON'
import sys
import numpy as np
from ricochet import read_run, write_start
folder, *names = sys.argv[1:]
for name in names:
    run = read_run(f"{folder}/{name}.h5")
    shifts = run.edges * np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    write_start(f"{folder}/{name}.txt", np.concatenate(run.position[-1] + shifts[:, None]))
PYTHON
}

disks 64 molten --set species.disks.placement=lattice --set species.disks.packing_fraction=0.66 \
  --scan stop.collisions_per_disk=20,30 "$@"
declare -A start=([crystal_0.73]='--set species.disks.placement=lattice')
for packing in 0.68 0.69 0.698 0.704 0.708 0.712 0.716 0.72; do
  for tau in 20 30; do
    start[molten_${tau}_$packing]="--set species.disks.placement=grown \
--set species.disks.file=$data/molten/collisions_per_disk_$tau.h5"
  done
done

runs=()
for side in "${sides[@]}"; do
  for name in "${!start[@]}"; do
    printf '%s\t%s --set species.disks.packing_fraction=%s\n' "$name" "${start[$name]}" "${name##*_}"
  done | sort | replace "$data/$side.txt"
  disks "$side" "$side" --set "stop.collisions_per_disk=${length[side]}" \
    --manifest "$data/$side.txt" "$@"
  [[ $side == "${sides[-1]}" || " $* " == *' --dry-run '* ]] ||
    copy_four_times "$data/$side" "${!start[@]}"
  for name in "${!start[@]}"; do
    runs+=("$data/$side/$name.h5")
    start[$name]="--set species.disks.file=$data/$side/$name.txt"
  done
done
"$python" post/melting.py "${runs[@]}" -o "$figures/melting.png" --csv "$figures/melting.csv"
for packing in 0.698 0.708 0.72; do
  "$python" post/snapshot.py "$data/$side/molten_20_$packing.h5" --colour psi6 \
    -o "$figures/melting_$packing.png"
done
