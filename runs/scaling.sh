#!/usr/bin/env bash

# Speed-up of runs on several cores of this computer. Takes about five minutes, in which no other program should run; not part of
# `make figures`. The systems are gases between walls at a packing fraction of 0.5, simulated for 6 million collisions (15 million
# for a million disks). Each system is simulated three times, alternately with 1, 2, 4, ... threads up to the number of cores.
#
# post/scaling.py draws the figure. To repeat the measurement, remove the folder runs/scaling.
#
# Examples of calls:
#
#   runs/scaling.sh
#   SIZES="10000 100000" THREADS="1 2 3" RUNS=5 runs/scaling.sh
set -euo pipefail
if (($# > 0)); then
  sed -n '2,/^[^#]/ s/^# \{0,1\}//p' "$0"
  [[ $1 == -h || $1 == --help ]] && exit 0 || exit 2
fi
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
program=${RICOCHET:-build/ricochet} python=${PYTHON:-.venv/bin/python} data=runs/scaling
mkdir -p "$data" runs/figures

cores=$(nproc)
threads=(1)
for ((k = 2; k < cores; k *= 2)); do threads+=("$k"); done
((cores == 1)) || threads+=("$cores")
read -ra threads <<<"${THREADS:-${threads[*]}}"
read -ra sizes <<<"${SIZES:-10000 100000 1000000}"

for disks in "${sizes[@]}"; do
  gas="name = 'gas', count = $disks, packing_fraction = 0.5"
  start=$data/start_$disks
  if ! [ -e "$start.h5" ]; then
    echo "&species $gas, temperature = 1 / &stop collisions_per_disk = 20 /" >"$start.nml"
    "$program" "$start.nml" -o "$start.h5" --quiet --set run.threads="$cores" >/dev/null
  fi
  echo "&species $gas, placement = 'file', file = '$start.h5', velocities = 'file' /
&stop collisions = $((disks > 400000 ? 15*disks : 6000000)) /" >"$data/gas_$disks.nml"
  for ((k = 1; k <= ${RUNS:-3}; k++)); do
    for n in "${threads[@]}"; do
      name=$data/gas_${disks}_${n}_$k
      [ ! -e "$name.h5" ] || continue
      printf '%s disks, %s threads\n' "$disks" "$n" >&2
      "$program" "$data/gas_$disks.nml" -o "$name.h5" --quiet --set run.threads="$n" >"$name.log"
    done
  done
done
"$python" post/scaling.py "$data"/gas_*.h5 -o runs/figures/scaling.png --csv runs/figures/scaling.csv
