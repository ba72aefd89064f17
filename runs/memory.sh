#!/usr/bin/env bash

# Memory per disk in different kinds of runs, compared with the program's own estimate (src/start/memory.f90).
#
# Measured is the peak resident memory of the process, estimated is the value printed by --check. The runs need about 250 bytes per
# disk, or 700 bytes with neighbour lists. Other programs may run meanwhile. The environment variable RICOCHET names the measured
# program (default build/ricochet).
#
# Examples of calls:
#
#   runs/memory.sh                measures 490 000 disks on one core, and 10^6 disks with domains
#   runs/memory.sh 10000000       measures 10^7 disks, and only the kinds of runs with domains
#   runs/memory.sh 490000 file    measures only the kinds of runs whose names contain the word "file"
set -euo pipefail
export LC_ALL=C # so that awk reads and writes 0.5 with a point in every language
case ${1:-} in -h | --help) sed -n '2,/^[^#]/ s/^# \{0,1\}//p' "$0"; exit 0 ;; esac
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
program=$(realpath "${RICOCHET:-build/ricochet}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
verdict=0

# kind DISKS NAME TEXT...: executes a run and prints a row of the table. The input file consists of the lines TEXT, with %N
# replaced by the number of disks. The output file is kept for other kinds of runs if NAME begins with `keep`.
kind() {
  local disks=$1 name=$2 out=$work/run.h5 assumed used
  shift 2
  [[ $name == *"$only"* || $name == keep* ]] || return 0
  [[ $name != keep* ]] || out=$work/${name#keep }.h5
  printf '%s\n' "${@//%N/$disks}" >"$work/run.nml"
  assumed=$("$program" "$work/run.nml" --check | sed 's/.*needs about \([0-9]*\) MB of memory.*/\1/')
  used=$(python3 -c 'import os, sys
child = os.spawnvp(os.P_NOWAIT, sys.argv[1], sys.argv[1:])
_, status, use = os.wait4(child, 0)
print("used", use.ru_maxrss)
sys.exit(status != 0)' "$program" "$work/run.nml" -o "$out" --force --quiet | awk '$1 == "used" { print $2 }')
  awk -v n="$disks" -v name="$name" -v assumed="$assumed" -v used="$used" 'BEGIN {
    used *= 1024; assumed *= 1e6
    printf "%9d  %-42s%8.0f%8.0f%+8.1f %%\n", n, name, used/n, assumed/n, 100*(assumed/used - 1)
    exit assumed < 0.95*used || (assumed > 1.05*used && name !~ /time steps/) }' || verdict=1
}

periodic="&box boundary = 'periodic', 'periodic' /"
stop='&stop collisions_per_disk = 2 /'
frames='&output frames_every_collisions = %N /'
disks() { echo "&species name = 'gas' count = %N velocities = 'maxwell' packing_fraction = $1 placement = '$2' ${3:-} /"; }
from() { echo "&species name = 'gas' count = %N packing_fraction = 0.5 placement = 'file' velocities = 'file' file = '$work/$1.h5' /"; }
lognormal="polydispersity = 0.398 radius_distribution = 'lognormal'"

serial() {
  local n=$1
  kind "$n" 'keep walls' "$(disks 0.5 lattice)" "$stop"
  kind "$n" 'packing 0.7' "$(disks 0.7 lattice)" "$stop"
  kind "$n" 'packing 0.1, random' "$(disks 0.1 random)" "$stop"
  kind "$n" 'packing 0.5, random' "$(disks 0.5 random)" "$stop"
  kind "$n" 'frames' "$(disks 0.5 lattice)" "$stop" "$frames"
  kind "$n" 'gravity and dissipation' "$(disks 0.5 lattice)" "$stop" '&box gravity = 0, -1 /' '&contact restitution = 0.9 /'
  kind "$n" 'keep periodic' "$periodic" "$(disks 0.5 lattice)" "$stop"
  kind "$n" 'periodic, random' "$periodic" "$(disks 0.5 random)" "$stop"
  kind "$n" 'periodic, frames' "$periodic" "$(disks 0.5 lattice)" "$stop" "$frames"
  kind "$n" 'rough, periodic, frames' "$periodic" "$(disks 0.5 lattice)" "$stop" "$frames" '&contact tangential_restitution = 0.5 /'
  kind "$n" 'from a file' "$(from walls)" "$stop"
  kind "$n" 'from a file, periodic, frames' "$periodic" "$(from periodic)" "$stop" "$frames"
  kind "$n" 'radii from 0.74 to 1.26' "$(disks 0.4 random "polydispersity = 0.15 radius_distribution = 'uniform'")" "$stop"
  kind "$n" 'lists of neighbours' "$(disks 0.45 random "$lognormal")" "$stop"
  kind "$n" 'neighbour lists, periodic, frames' "$periodic" "$(disks 0.45 random "$lognormal")" "$stop" "$frames"
  kind "$n" 'driving, periodic' "$periodic" "$(disks 0.5 lattice)" '&stop time = 1e-3 /' \
    "&drive kind = 'noise' strength = 1 interval = 1e-4 /"
  kind "$n" 'piston' "$(disks 0.5 lattice)" "$stop" "&side name = 'right' motion = 'piston' mass = 100 force = 1 /"
  kind "$((n/5))" 'dense growth' "$(disks 0.7 dense)" "$stop"
  kind "$((n/5))" 'dense growth, periodic' "$periodic" "$(disks 0.7 dense)" "$stop"
  kind "$n" 'time steps' "$(disks 0.5 lattice)" '&stop time = 1e-6 /' "&run dynamics = 'steps' dt = 1e-7 /"
}

divided() {
  local n=$1 stop='&stop collisions_per_disk = 6 /' # shorter runs do not use domains
  kind "$n" 'domains, random' "$(disks 0.5 random)" "$stop"
  kind "$n" 'domains, lattice' "$(disks 0.5 lattice)" "$stop"
  kind "$n" 'domains, periodic' "$periodic" "$(disks 0.5 lattice)" "$stop"
  kind "$n" 'domains, neighbour lists' "$(disks 0.45 random "$lognormal")" "$stop"
}

only=${2:-}
printf '%9s  %-42s%8s%8s%10s\n' disks 'bytes per disk' measured assumed difference
if [ "${1:-490000}" -lt 500000 ]; then serial "${1:-490000}"; fi
if [ "${1:-1000000}" -ge 500000 ]; then divided "${1:-1000000}"; fi
exit $verdict
