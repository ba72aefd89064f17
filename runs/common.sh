# shellcheck shell=bash
# Common part of the scripts of the systems; the first line of each reads it. It sets python, data (the
# folder of the runs), figures (that of the figures) and `replace`. Options of ensemble.sh, such as
# -j 4, go through.
set -euo pipefail
if [[ " $* " == *' -h '* || " $* " == *' --help '* ]]; then
  sed -n '2,/^[^#]/ s/^# \{0,1\}//p' "$0"
  printf 'Figures in runs/figures; options as those of ensemble.sh, such as -j 4, go through.\n'
  exit 0
fi
export LC_ALL=C # so that awk writes 0.5, whatever the language
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-.venv/bin/python} data=runs/$(basename -- "$0" .sh) figures=runs/figures
command -v "$python" >/dev/null || {
  printf '%s: no %s to draw the figures: run make demo, or set PYTHON\n' "${0##*/}" "$python" >&2
  exit 2
}
mkdir -p -- "$data" "$figures"

# FILE becomes what comes in; a link in its place goes, and nothing is written through it.
replace() {
  rm -f -- "$1" && (set -C && cat >"$1")
}
