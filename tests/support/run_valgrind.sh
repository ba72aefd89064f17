#!/usr/bin/env bash
# Performs one small run of each kind under valgrind, and checks that there are no errors and no memory leaks.
# usage: run_valgrind.sh PROGRAM     (built for a processor that valgrind knows, as ARCH=x86-64-v3)
set -euo pipefail
program=$(realpath "$1")
inputs=$(realpath "$(dirname "$0")/../../input")
command -v valgrind >/dev/null || { echo 'run_valgrind.sh: valgrind is missing' >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# Arguments: the expected exit status, then the arguments of the program.
watched() {
  local right=$1 status=0
  shift
  valgrind --quiet --leak-check=full --errors-for-leak-kinds=definite,possible --error-exitcode=9 \
    "$program" "$@" --quiet >"$work/log" 2>&1 || status=$?
  if [ "$status" -ne "$right" ]; then
    echo "valgrind: ricochet $*: status $status instead of $right" >&2
    tail -n 40 "$work/log" >&2
    exit 1
  fi
  runs=$((runs + 1))
}

runs=0
few=(--set stop.events=5000)
watched 0 "$inputs/gas.nml" -o gas.h5 "${few[@]}" --set output.event_log=T --set output.frames_every_events=500
watched 0 "$inputs/gas.nml" -o heap.h5 "${few[@]}" --set run.queue=heap --set box.boundary=periodic,periodic
watched 0 "$inputs/gas.nml" -o pairs.h5 --set stop.events=500 --set run.search=pairs --set species.gas.count=50
watched 0 "$inputs/crater.nml" -o crater.h5 "${few[@]}" --set output.precision=single
watched 0 "$inputs/gravity.nml" -o gravity.h5 "${few[@]}"
watched 0 "$inputs/gravity_steps.nml" -o steps.h5 --set stop.time=0.5
watched 0 "$inputs/lorentz.nml" -o lorentz.h5 "${few[@]}"
watched 0 "$inputs/bulk.nml" -o dense.h5 "${few[@]}" --set species.disks.placement=dense --set species.disks.count=100
for driven in heated active hopper; do
  watched 0 "$inputs/$driven.nml" -o "$driven.h5" "${few[@]}" --set stop.time=1 --set run.threads=2
done
watched 75 "$inputs/cooling.nml" -o stopped.h5 --set stop.wall_clock=0.01
watched 75 "$inputs/cooling.nml" -o stopped.h5 --set stop.wall_clock=0.01 --resume
watched 0 --explain species
watched 0 "$inputs/gas.nml" --check --set species.gas.radius=0.001
watched 2 "$inputs/gas.nml" --check --set species.gas.radius=nan --set box.uper=1,1
echo "valgrind: $runs runs without errors and leaks"
