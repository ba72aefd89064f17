#!/usr/bin/env bash
# Runs the unit tests and believes them only with exit status 0, the OK line, and as many tests as
# the .pf files mark with @test: a `stop` in tested code, say, would end the run early with status 0.
# usage: [LIMIT=SECONDS] run_unit_tests.sh RUNNER PROGRAM FILE.pf...
set -euo pipefail
runner=$1 program=$2 limit=${LIMIT:-300}
shift 2
expected=$(cat "$@" | grep -ciE '^[[:space:]]*@test[[:space:]]*$')
echo "$expected unit tests under $runner"
status=0
output=$(timeout "$limit" "$program" 2>&1) || status=$?
printf '%s\n' "$output"
if [ "$status" -eq 124 ]; then
  echo "unit tests: stopped after $limit s" >&2
fi
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
