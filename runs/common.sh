# shellcheck shell=bash

# Shared by the scripts in this folder that simulate a system: the variables `python` (Python interpreter), `data` (folder of
# output files) and `figures` (folder of figures), and the function `replace`. Options such as -j 4 are passed on to ensemble.sh.
set -euo pipefail
if [[ " $* " == *' -h '* || " $* " == *' --help '* ]]; then
  sed -n '2,/^[^#]/ s/^# \{0,1\}//p' "$0"
  printf 'The figures are written to runs/figures; options are passed to ensemble.sh, for example -j 4.\n'
  exit 0
fi
export LC_ALL=C # so that awk writes 0.5 with a point in every language
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-.venv/bin/python} data=runs/$(basename -- "$0" .sh) figures=runs/figures
command -v "$python" >/dev/null || {
  printf '%s: no %s to draw the figures: run make demo, or set PYTHON\n' "${0##*/}" "$python" >&2
  exit 2
}
mkdir -p -- "$data" "$figures"

# replace FILE: writes standard input to FILE. A symbolic link is replaced by a file; its target does not change.
replace() {
  rm -f -- "$1" && (set -C && cat >"$1")
}
