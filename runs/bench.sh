#!/usr/bin/env bash
# Measures what a collision costs: equal disks, elastic, in a walled box, observables on, one core.
# Prints million collisions per second of processor time, the median of some runs.
#
#   runs/bench.sh            N = 1e3, 1e4, 1e5 at four packings, and all pairs at N = 1e3
#   runs/bench.sh --full     N = 1e6 as well
#   runs/bench.sh --check    instructions per collision against what is promised (needs valgrind)
#
# Nothing else should run meanwhile. RUNS=5 and RICOCHET=build/ricochet can be set.
set -euo pipefail

program=${RICOCHET:-build/ricochet}
repeats=${RUNS:-3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# input DISKS PACKING COLLISIONS SEARCH: writes the input file of one state.
input() {
  local placement=random
  [ "$2" = 0.7 ] && placement=lattice            # beyond what random insertion reaches; it melts at once
  cat >"$work/bench.nml" <<EOF
&run search = '$4' /
&species name = 'gas', count = $1, packing_fraction = $2, placement = '$placement', velocities = 'maxwell' /
&stop collisions = $3 /
&output observables_every_collisions = $((5 * $1)) /
EOF
}

# rate DISKS PACKING COLLISIONS [SEARCH]: median rate in million collisions per second.
rate() {
  input "$1" "$2" "$3" "${4:-cells}"
  for ((run = 0; run < repeats; run++)); do
    "$program" "$work/bench.nml" -o "$work/bench.h5" --force --quiet |
      awk '$1 == "collisions_per_second" { print $3/1e6 }'
  done | sort -n | awk '{ r[NR] = $1 } END { printf "%.2f", r[int((NR + 1)/2)] }'
}

# instructions DISKS PACKING: per collision, from two lengths of the same run.
instructions() {
  local short long length
  for length in 40000 90000; do
    input "$1" "$2" "$length" cells
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$program" "$work/bench.nml" \
      -o "$work/bench.h5" --force --quiet >/dev/null 2>"$work/count"
    short=${long:-}
    long=$(awk '/Collected/ { print $4 }' "$work/count")
  done
  echo $(((long - short) / 50000))
}

check() {
  local packing limit count verdict=0
  while read -r packing limit; do
    count=$(instructions 1000 "$packing")
    printf 'packing %s: %s instructions per collision, at most %s\n' "$packing" "$count" "$limit"
    [ "$count" -le "$limit" ] || verdict=1
  done <<EOF
0.5 ${LIMIT_FLUID:-1600}
0.7 ${LIMIT_DENSE:-1700}
EOF
  return $verdict
}

table() {
  local packing disks sizes=(1000 10000 100000)
  [ "${1:-}" = --full ] && sizes+=(1000000)
  printf 'million collisions per second of processor time\n%-10s' packing
  printf '%10s' "${sizes[@]/#/N=}"
  printf '\n'
  for packing in 0.05 0.1 0.3 0.5 0.7; do
    printf '%-10s' "$packing"
    for disks in "${sizes[@]}"; do
      printf '%10s' "$(rate "$disks" "$packing" $((disks < 1000000 ? 4000000 : 6000000)))"
    done
    printf '\n'
  done
  printf 'all pairs, N=1000, packing 0.5: %s\n' "$(rate 1000 0.5 20000 pairs)"
}

case ${1:-} in
  --check) check ;;
  --full | '') table "${1:-}" ;;
  *) sed -n '2,9s/^# \{0,1\}//p' "$0"; exit 2 ;;
esac
