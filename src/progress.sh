# Functions that display the progress of long commands, for the Makefile and for .ci/set-up. On a terminal each line
# replaces the previous one.
# shellcheck shell=sh

on_terminal() { [ -t 1 ] && [ "${TERM:-dumb}" != dumb ]; }

# announce TEXT COMMAND...: prints TEXT, runs COMMAND, and reports every five seconds that it is still running.
announce() {
  announced=$1 self=$$
  shift
  echo "$announced"
  (
    seconds=0 pattern='  ... %d s\n'
    if on_terminal; then pattern='\r  ... %d s'; fi
    # The output of `sleep` must be closed. Otherwise a pipe would stay open after the end.
    while sleep 5 >/dev/null 2>&1 && kill -0 "$self" 2>/dev/null; do
      seconds=$((seconds + 5))
      # shellcheck disable=SC2059
      printf "$pattern" "$seconds"
    done
  ) </dev/null &
  ticker=$!
  status=0
  "$@" || status=$?
  kill "$ticker" 2>/dev/null
  wait "$ticker" 2>/dev/null || true
  if on_terminal; then printf '\r\033[K'; fi
  return "$status"
}

# count LIST TOTAL VERB FILE: prints "VERB n of TOTAL: FILE", where n is the number of calls since the file LIST was
# emptied. An empty TOTAL means that the total is unknown.
count() {
  echo "$4" >>"$1"
  line="$3 $4"
  [ -z "$2" ] || line="$3 $(grep -nxF "$4" "$1" | cut -d : -f 1) of $2: $4"
  if on_terminal && [ -n "$2" ]; then printf '\r%.78s\033[K' "$line"; else echo "$line"; fi
}
