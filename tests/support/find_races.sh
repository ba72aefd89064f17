#!/usr/bin/env bash
# Searches for races between threads with the thread sanitizer, in the unit tests of domains and in whole runs of all kinds.
# usage: find_races.sh BUILD     (a folder with `ricochet` and `unit_tests`, built with -fsanitize=thread)
#
# The sanitizer cannot observe how the OpenMP library of GNU synchronises threads. The OpenMP library of LLVM has the same
# functions, and its tool Archer reports the synchronisation to the sanitizer. Therefore this script uses the library of LLVM
# instead of the library of GNU. The script first tests that the sanitizer reports a race in a program with a race, and no race in a
# program with synchronised threads.
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$(realpath "$1")
archer=$(find /usr/lib* /usr/local/lib* -name libarcher.so 2>/dev/null | sort | tail -n 1)
if [ -z "$archer" ]; then
  echo 'races: not searched: the tool Archer of LLVM (libarcher.so; Debian: libomp-14-dev) is not installed'
  exit 0
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ln -s "${archer%/*}/libomp.so" "$work/libgomp.so.1"
export TSAN_OPTIONS=halt_on_error=1:exitcode=66:ignore_noninstrumented_modules=1

# Runs a command with the libraries that the sanitizer requires.
watched() { LD_LIBRARY_PATH=$work OMP_TOOL_LIBRARIES=$archer "$@"; }

# Arguments: the expected exit status, and the index of the element of n that an iteration of the loop changes.
expect() {
  local status=0
  # shellcheck disable=SC2016
  printf '%s\n' 'integer :: i, k, n(100)' 'n = 0' 'do k = 1, 9' '!$omp parallel do num_threads(2)' 'do i = 1, 100' \
    "n($2) = n($2) + i" 'end do' 'end do' 'if (sum(n) < 0) print *, n' 'end' >"$work/try.f90"
  gfortran -g -fopenmp -fsanitize=thread "$work/try.f90" -o "$work/try"
  watched "$work/try" >"$work/log" 2>&1 || status=$?
  [ "$status" -eq "$1" ] || { echo "races: the detector is not to be trusted: status $status instead of $1" >&2; exit 1; }
}

expect 66 'mod(i*k, 7) + 1'
expect 0 'mod(i + k, 100) + 1'
watched "$build/unit_tests"
BYTES=unlimited SYSTEMS=20 RICOCHET=$build/ricochet watched .venv/bin/python -m pytest -q \
  tests/runs/test_random_systems.py -k all_ways
echo 'races: none found'
