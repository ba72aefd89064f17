#!/usr/bin/env bash
# Runs the unit tests and believes them only with exit status 0, the OK line, and as many tests as
# the .pf files mark with @test: a `stop` in tested code, say, would end the run early with status 0.
# They get LIMIT seconds of processor time, so that a busy machine stops nothing, and two hours by the clock. Threads
# that wait leave their cores to the others: some tests have more threads than there are cores.
# usage: [LIMIT=SECONDS] run_unit_tests.sh RUNNER PROGRAM FILE.pf...
set -euo pipefail
runner=$1 program=$2 limit=${LIMIT:-300} hours=2
export OMP_WAIT_POLICY=passive
shift 2
expected=$(cat "$@" | grep -ciE '^[[:space:]]*@test[[:space:]]*$')
echo "$expected unit tests under $runner"
status=0
output=$(ulimit -S -c 0 -t "$limit" && timeout "${hours}h" "$program" 2>&1) || status=$?
printf '%s\n' "$output"
case $status in
  124) echo "unit tests: stopped after $hours hours" >&2 ;;
  152) echo "unit tests: stopped after $limit s of processor time" >&2 ;; # by SIGXCPU
esac
if [ "$status" -ne 0 ]; then
  exit "$status"
fi
if ! grep -q '^ *OK *$' <<<"$output"; then
  echo 'unit tests: the run ended before the OK line' >&2
  exit 1
fi
if ! grep -qE "^ *\($expected tests?\)" <<<"$output"; then
  echo "unit tests: not all of the $expected tests ran" >&2
  exit 1
fi
