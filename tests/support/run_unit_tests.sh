#!/usr/bin/env bash
# Runs the unit tests. They pass only if the exit status is 0, the OK line is printed, and the number of tests is that of the @test
# marks in the .pf files: a `stop` in tested code, for example, would end the run early with status 0. The limits are LIMIT seconds of
# processor time, which do not depend on the load of the machine, and two hours of wall time. Waiting threads release their cores,
# because some tests have more threads than there are cores.
# usage: [LIMIT=SECONDS] run_unit_tests.sh RUNNER PROGRAM FILE.pf...
set -euo pipefail
runner=$1 program=$2 limit=${LIMIT:-300} hours=2
export OMP_WAIT_POLICY=passive
shift 2
expected=$(cat "$@" | grep -ciE '^[[:space:]]*@test[[:space:]]*$')
. "$(dirname "$0")/../../src/progress.sh"
# The file has no name any more, since a trap that removes it could also run in the background process of `announce`, if this process
# ends before it has reset the traps.
log=$(mktemp)
exec 3>"$log"
exec 4<"$log"
rm "$log"
run() { (ulimit -S -c 0 -t "$limit" && timeout "${hours}h" "$program" >&3 2>&1); }
status=0
announce "$expected unit tests under $runner" run || status=$?
output=$(cat <&4)
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
