#!/usr/bin/env bash

# Benchmarks: cost of collisions, of the start of a run and of the output. docs/explanation/performance.md explains the results.
#
# A rate is the number of collisions per second of processor time, in millions. It is measured on one core, in runs that also
# sample observables. The printed rate is the median of RUNS=5 runs. Before each measurement, the system is simulated until it
# is independent of its initial state. No other program should run meanwhile. The environment variable RICOCHET names the
# measured program (default build/ricochet). --check requires a program compiled without AVX-512 instructions, which valgrind
# cannot execute.
#
# Examples:
#
#   runs/bench.sh            measures 1e3 to 1e5 disks at four packing fractions, also with gravity and other features
#   runs/bench.sh --full     also measures 1e6 disks, the random start, the memory, and runs on two cores
#   runs/bench.sh --check    compares the numbers of instructions per collision with their limits (requires valgrind)
set -euo pipefail
export LC_ALL=C # so that awk reads and writes 0.5 with a point in every language
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."

program=$(realpath "${RICOCHET:-build/ricochet}")
repeats=${RUNS:-5}
full=
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
one_core=()
if command -v taskset >/dev/null; then one_core=(taskset -c $(($(nproc) - 1))); fi

# --- Preparation of starting states, and single runs -----------------------------------------------

# input FILE START SPECIES...: writes an input file, in which the variables START define the initial state of each species.
input() {
  local file=$1 start=$2 species
  shift 2
  for species; do echo "&species $species, $start /"; done >"$file"
}

# state NAME SPECIES...: simulates the disks SPECIES for 20 collisions per disk, and writes the input file $work/NAME.nml, which
# starts from the last frame. Initial positions are random or, at packing fractions too high for random insertion, on a lattice. A
# lattice of 1e5 disks or more does not melt within these 20 collisions per disk.
state() {
  local name=$1 placement=random
  shift
  [ -e "$work/$name.nml" ] && return
  [[ $* == *'packing_fraction = 0.7'* ]] && placement=lattice
  [[ $* == *'packing_fraction = 0.7, polydispersity'* ]] && placement=dense
  input "$work/start.nml" "placement = '$placement', velocities = 'maxwell'" "$@"
  "$program" "$work/start.nml" -o "$work/$name.h5" --quiet --set stop.collisions_per_disk=20 >/dev/null
  input "$work/$name.nml" "placement = 'file', file = '$work/$name.h5', velocities = 'file'" "$@"
}

# gas DISKS PACKING: prepares an initial state of equal disks at the packing fraction PACKING.
gas() { state "gas_$1_$2" "name = 'gas', count = $1, packing_fraction = $2"; }

# polydisperse DISTRIBUTION DISKS PACKING: prepares an initial state of polydisperse disks with a size ratio of up to 9.9.
polydisperse() {
  local spread=0.472
  [ "$1" = lognormal ] && spread=0.398
  state "$1_$2_$3" "name = 'gas', count = $2, packing_fraction = $3, polydispersity = $spread, radius_distribution = '$1', mass_scaling = 'area'"
}

# run NAME COLLISIONS [OPTION...]: executes a run that starts from the state NAME.
run() {
  local name=$1 collisions=$2
  shift 2
  "${run_by[@]}" "$program" "$work/$name.nml" -o "$work/bench.h5" --force --quiet --set "stop.collisions=$collisions" "$@"
}

# rate NAME COLLISIONS [OPTION...]: prints the rate of a run, in millions of collisions per second.
rate() {
  run_by=("${one_core[@]}")
  run "$@" | awk '$1 == "collisions_per_second" { print $3/1e6 }'
}

median() { sort -g | awk '{ r[NR] = $1 } END { printf "%.3f", r[int((NR + 1)/2)] }'; }

repeated() { local k; for ((k = 0; k < repeats; k++)); do "$@"; done; }

# --- Rates for several numbers of disks and packing fractions -------------------------------------------------------------------

samples() { echo "output.observables_every_collisions=$((5 * $1))"; } # for this number of disks

table() {
  local packing disks sizes=(1000 10000 100000)
  [ "$full" ] && sizes+=(1000000)
  printf '\n%-10s' packing
  printf '%10s' "${sizes[@]/#/N=}"
  for packing in 0.1 0.3 0.5 0.7; do
    printf '\n%-10s' "$packing"
    for disks in "${sizes[@]}"; do
      gas "$disks" "$packing"
      printf '%10.2f' "$(repeated rate "gas_${disks}_$packing" 6000000 --set "$(samples "$disks")" | median)"
    done
  done
  printf '\n\nall pairs, N=1000, packing 0.5: %.3f\n' \
    "$(repeated rate gas_1000_0.5 20000 --set run.search=pairs | median)"
}

# --- Rates with and without an additional option, measured alternately ------------------------------------

# beside WHAT LEAST NAME OTHER COLLISIONS [OPTION...]: measures the rate of a run from the state NAME without options, and of a
# run from the state OTHER with the options. Prints both rates, and the ratio of the second to the first.
beside() {
  local what=$1 least=$2 name=$3 other=$4 collisions=$5 k
  shift 5
  for ((k = 0; k < repeats; k++)); do
    rate "$name" "$collisions" >>"$work/without"
    rate "$other" "$collisions" "$@" >>"$work/with"
  done
  awk -v what="$what" -v least="$least" -v without="$(median <"$work/without")" -v with="$(median <"$work/with")" \
    'BEGIN { printf "%-52s%8.2f%10.2f%10.3f%10s\n", what, without, with, with/without, least }'
  rm "$work/without" "$work/with"
}

costs() {
  local g=gas_10000_0.5 frames="output.frames_every_collisions=50000" disks
  printf '\n%-52s%8s%10s%10s%10s\n' 'with one more option (packing 0.5)' without with ratio 'at least'
  gas 10000 0.5
  gas 100000 0.5
  beside 'gravity' 0.87 $g $g 6000000 --set box.gravity=0,-1
  beside 'periodic sides' 0.95 $g $g 6000000 --set box.boundary=periodic,periodic
  beside 'restitution and TC model' 0.95 $g $g 6000000 --set contact.restitution=0.999999 \
    --set contact.contact_time=1e-9
  beside 'observables, ten collisions per disk apart' 0.97 $g $g 6000000 --set "$(samples 10000)"
  beside '1e5 disks: frames, one collision per disk apart' 0.91 gas_100000_0.5 gas_100000_0.5 3000000 --set "$frames"
  state sizes "${sizes[@]}"
  beside 'radii from 1 to 1.4' 0.85 $g sizes 6000000 --set "$(samples 10000)"
  for disks in 100000 ${full:+1000000}; do
    gas "$disks" 0.5
    state "crater_$disks" "name = 'gas', count = $disks, packing_fraction = 0.5" \
      "name = 'projectile', count = 1, relative_to = 'gas', radius = 5, mass = 25"
    beside "$disks disks: a projectile of 5 radii" 0.90 "gas_${disks}_0.5" "crater_$disks" 6000000
  done
  gas 100000 0.45
  state brownian "name = 'gas', count = 100000, packing_fraction = 0.45" \
    "name = 'brownian', count = 1, relative_to = 'gas', radius = 100, mass = 1000"
  beside '1e5 disks, packing 0.45: a disk of 100 radii' 0.90 gas_100000_0.45 brownian 6000000
}

# The mixture has five species with the radii 1, 1.1, ..., 1.4 and a total packing fraction of 0.5.
sizes=()
for tenths in 10 11 12 13 14; do
  sizes+=("name = 'r$tenths', count = 2000, packing_fraction = $(awk -v r=$tenths 'BEGIN { print r*r/1460 }')")
done

# --- Time and memory of complete processes -----------------------------------------------------------

# process COMMAND...: prints the processor time [s] and the memory [bytes] that the command uses.
process() {
  python3 -c 'import os, sys
child = os.spawnvp(os.P_NOWAIT, sys.argv[1], sys.argv[1:])
_, status, use = os.wait4(child, 0)
print("used", use.ru_utime + use.ru_stime, 1024*use.ru_maxrss)
sys.exit(status != 0)' "$@" | awk '$1 == "used" { print $2, $3 }'
}

# seconds COMMAND...: prints the wall time of the command [s].
seconds() {
  local TIMEFORMAT=%R
  { time "$@" >/dev/null 2>&3; } 3>&2 2>&1
}

processes() {
  local start random big one two
  start=$(repeated process "$program" input/gravity.nml -o "$work/bench.h5" --force --quiet --set stop.time=0.01 |
    awk '{ print 1000*$1 }' | median)
  printf '\nwhole processes\n'
  printf '%-52s%8.1f ms, at most 20\n' 'a run of 60 disks, processor time' "$start"
  [ "$full" ] || return 0
  input "$work/start.nml" "placement = 'random', velocities = 'maxwell'" "name = 'gas', count = 1000000, packing_fraction = 0.5"
  random=$(process "$program" "$work/start.nml" --check --set stop.collisions=1)
  printf '%-52s%8.1f s, at most 15\n' 'a random start of 1e6 disks at 0.5, processor time' "${random% *}"
  run_by=(process)
  big=$(run gas_1000000_0.5 1000000)
  printf '%-52s%8.0f bytes per disk, at most 300\n' '1e6 disks, memory' "$((${big#* }/1000000))"
  [ "$(nproc)" -ge 2 ] || return 0
  one=$(seconds ensemble 1)
  two=$(seconds ensemble 2)
  printf '%-52s%8.2f times as fast, at least 1.9\n' 'four runs on two cores' "$(awk -v one="$one" -v two="$two" 'BEGIN { print one/two }')"
}

# faster WHAT LEAST NAME COLLISIONS [OPTION...]: prints the speedup of complete runs: the wall time with one thread, divided by
# the wall time with two threads.
faster() {
  local what=$1 least=$2 k threads
  shift 2
  run_by=()
  for ((k = 0; k < repeats; k++)); do
    for threads in 1 2; do seconds run "$@" --set "run.threads=$threads" >>"$work/threads$threads"; done
  done
  awk -v what="$what" -v least="$least" -v one="$(median <"$work/threads1")" -v two="$(median <"$work/threads2")" \
    'BEGIN { printf "%-52s%8.2f%10.2f%10.2f%10s\n", what, one, two, one/two, least }'
  rm "$work/threads1" "$work/threads2"
}

threads() {
  local packing disks least=1.5 length=6000000
  [ "$full" ] && [ "$(nproc)" -ge 2 ] || return 0
  printf '\n%-52s%8s%10s%10s%10s\n' 'one run on two cores, seconds' 'one' two ratio 'at least'
  for disks in 10000 100000 1000000; do
    for packing in 0.1 0.5 0.7; do
      gas "$disks" "$packing"
      faster "$disks disks, packing $packing" "$least" "gas_${disks}_$packing" $length
    done
    least=$([ "$disks" = 10000 ] && echo 1.85 || echo 1.9)
    [ "$disks" = 10000 ] || length=24000000
  done
  faster 'restitution 0.9, 100000 disks, packing 0.5' 1.6 gas_100000_0.5 6000000 --set contact.restitution=0.9
  faster 'gravity, 100000 disks, packing 0.5' 1.6 gas_100000_0.5 6000000 --set box.gravity=0,-1
}

# ensemble JOBS: executes four runs of several seconds each, JOBS of them at a time.
ensemble() {
  RICOCHET=$program runs/ensemble.sh "$work/gas_10000_0.5.nml" -d "$work/ensemble$1" --seeds 1-4 -j "$1" \
    --set stop.collisions=20000000
}

# --- Numbers of instructions, compared with their limits ----------------------------------------------

# instructions RADII PACKING COLLISIONS [OPTION...]: counts the instructions in the event loop and at the start of epochs (periods
# between two shifts of the time origin). Other parts of a run (start, output) do not count, because their number of instructions
# depends on the time of day. The runs have 1000 equal disks, or 4000 disks with many different radii.
instructions() {
  local radii=$1 packing=$2 collisions=$3 name
  shift 3
  if [ "$radii" = equal ]; then
    name=gas_1000_$packing
    gas 1000 "$packing"
  else
    name=${radii}_4000_$packing
    polydisperse "$radii" 4000 "$packing"
  fi
  counted run "$name" "$collisions" "$@"
}

# counted COMMAND...: executes COMMAND, which runs the simulation program under valgrind, and prints the number of instructions.
counted() {
  run_by=(valgrind --tool=callgrind --callgrind-out-file=/dev/null)
  run_by+=(--toggle-collect=__{event_driven_MOD_{advance,start,renew},epochs_MOD_move_epoch,{andersen,brownian,noise,active}_MOD_kick}'*')
  "$@" >/dev/null 2>"$work/count" || { cat "$work/count" >&2; return 1; }
  awk '/Collected/ { print $4 }' "$work/count"
}

# obstacles NAME: writes the input file $work/NAME.nml with one disk among circular obstacles. NAME selects a square lattice of
# obstacles, the pattern of a pegboard, or the Lorentz gas of an input file.
obstacles() {
  local file=$work/$1.nml kind=${1%_*} number=${1#*_}
  case $kind in
    scatterers)
      awk -v n="$number" 'BEGIN { print "x y radius"; for (k = 0; k < n*n; k++) print k%n + 0.5, int(k/n) + 0.5, 0.31 }' >"$work/$1.txt"
      echo "&box upper = $number, $number boundary = 'periodic', 'periodic' / &obstacle file = '$work/$1.txt' /
        &species radius = 0.05 position = 0.02, 0.01 velocity = 0.6, 0.8 /" >"$file"
      ;;
    board)
      awk -v n="$number" 'BEGIN { print "x y radius"; for (k = 0; k < n; k++) {
        row = 2*int(k/11) + (k%11 > 5); print (row%2 ? k%11 - 5 : k%11 + 0.5), 7 - 0.8*row, 0.1 } }' >"$work/$1.txt"
      echo "&box upper = 6, 8 gravity = 0, -1 / &obstacle file = '$work/$1.txt' /
        &species radius = 0.1 position = 3.03, 7.5 velocity = 0.1, 0 /" >"$file"
      ;;
    *) sed '/^&stop/,$d' "input/$1.nml" >"$file" ;;
  esac
  echo '&stop events = 1 /' >>"$file"
}

# events NAME NUMBER: simulates one disk among obstacles for NUMBER events.
events() {
  "${run_by[@]}" "$program" "$work/$1.nml" -o "$work/bench.h5" --force --quiet --set "stop.events=$2"
}

# piston DISKS: writes the input file $work/piston_DISKS.nml of a gas at a packing fraction of 0.2, in mechanical equilibrium with
# a piston that has a tenth of the mass of the gas.
piston() {
  gas "$1" 0.2
  { echo "&side name = 'right' motion = 'piston' mass = $(($1/10)) force = $((3*$1/2)) /" && cat "$work/gas_$1_0.2.nml"; } \
    >"$work/piston_$1.nml"
}

# kicked NUMBER: simulates a gas of 1000 disks in a periodic box with a thermostat that changes all velocities NUMBER times, at
# intervals of a tenth of the mean free time.
kicked() {
  local interval=8.5e-4
  "${run_by[@]}" "$program" "$work/gas_1000_0.3.nml" -o "$work/bench.h5" --force --quiet --set box.boundary=periodic,periodic \
    --set drive.kind=brownian --set drive.temperature=1 --set drive.interval=$interval \
    --set "stop.time=$(awk -v n="$1" -v dt=$interval 'BEGIN { print (n + 0.5)*dt }')"
}

check() {
  local radii packing name disks limit options count driving=1342 verdict=0
  while read -r radii packing limit options; do
    # shellcheck disable=SC2086 # the variable contains any number of options
    count=$((($(instructions "$radii" "$packing" 100000 $options) - $(instructions "$radii" "$packing" 1 $options))/100000))
    printf '%s radii, packing %s%s: %s instructions per collision, at most %s\n' "$radii" "$packing" "${options:+, ${options#--set }}" "$count" "$limit"
    [ "$count" -gt 0 ] && [ "$count" -le "$limit" ] || verdict=1
  done <<'LIMITS'
equal 0.5 2087
equal 0.5 2500 --set box.gravity=0,-1
LIMITS
  while read -r name limit; do
    obstacles "$name"
    count=$((($(counted events "$name" 10200) - $(counted events "$name" 200))/10000))
    printf 'one disk, %s: %s instructions per event, at most %s\n' "${name/_/ }" "$count" "$limit"
    [ "$count" -gt 0 ] && [ "$count" -le "$limit" ] || verdict=1
  done <<'LIMITS'
scatterers_35 2430
LIMITS
  return $verdict
}

conditions() {
  local flags
  flags=$(dirname "$program")/flags
  echo "machine   $(nproc) x $(awk -F ': ' '/model name/ { print $2; exit }' /proc/cpuinfo)"
  echo "load      $(cut -d ' ' -f 1-3 /proc/loadavg) at $(date -u +%FT%RZ)"
  echo "program   $("$program" --version | sed 1q), commit $(git describe --always --dirty 2>/dev/null || echo unknown)"
  [ ! -e "$flags" ] || echo "built by  $(cat "$flags")"
  awk '$1 > 0.5 { print "Other programs are running: these results are unreliable." }' /proc/loadavg
}

case ${1:-} in
  --check) check ;;
  --full | '')
    full=${1:-}
    conditions
    table
    costs
    processes
    threads
    ;;
  *) sed -n '3,15s/^# \{0,1\}//p' "$0"; exit 2 ;;
esac
