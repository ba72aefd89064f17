# shellcheck shell=bash
# shellcheck disable=SC2154,SC2034 # ensemble.sh assigns `folder` and other variables, and reads variables that this file assigns

# Functions with which ensemble.sh reads and writes the files of a sweep. They determine from the files in `folder` which member
# runs are finished, have failed or can continue, and they check and store the settings of the member runs. They never write through
# links, into FIFOs, or into files that ensemble.sh did not create. Errors are reported by `fail` and `die` of ensemble.sh.

# may_be_ours FILE: succeeds if FILE does not exist or is an ordinary file.
may_be_ours() { [[ ! -L $1 && (! -e $1 || -f $1) ]]; }

check_ordinary() {
  may_be_ours "$1" ||
    fail 3 "$1 is not an ordinary file: remove it, or choose another folder"
}

# put FILE: writes standard input to FILE, completely or not at all. An existing file is replaced by a new one, so that other hard
# links keep its old contents.
put() {
  local new=$folder/.new.$$.${HOSTNAME:-} reason
  check_ordinary "$1"
  if ! reason=$({ rm -f -- "$new" && (set -C && cat >"$new") && mv -fT -- "$new" "$1"; } 2>&1); then
    rm -f -- "$new" 2>/dev/null || true
    fail 3 "cannot write $1: ${reason##*: }"
  fi
}

# Sets `last_line` to the last line in the log file of the member run NAME. No process is started, which would be too slow for up
# to 100 000 member runs.
read_last_line() {
  local lines=()
  last_line=''
  [[ -s $folder/$1.log ]] && may_be_ours "$folder/$1.log" || return 0
  { mapfile -t lines <"$folder/$1.log"; } 2>/dev/null || return 0
  ((${#lines[@]} == 0)) || last_line=${lines[-1]}
}

# Prints the last line in the log file of the member run NAME.
last_words() {
  local last_line
  read_last_line "$1"
  printf '%s\n' "$last_line"
}

is_finished=': is a finished run, ' # the answer to --resume if a stop condition is satisfied already
goes_on='^(stopped .*|killed by signal .*|.*--resume continues.*|)$' # last line in the log of a member run that has not failed

# Succeeds if the member run NAME has a finished output file, or one from which it can continue. The log of a failed member run
# gives the reason.
has_data() { [[ -e $folder/$1.h5 || -e $folder/$1.h5.part && $(last_words "$1") =~ $goes_on ]]; }

# An output file that is older than the input file, or is being extended by a run, does not count as finished.
is_done() { [[ -e $folder/$1.h5 && ! -e $folder/$1.h5.part && ! $folder/input.nml -nt $folder/$1.h5 ]]; }

# may_continue NAME OVERRIDES: succeeds if the program can continue the member run NAME with the settings OVERRIDES.
may_continue() {
  local arguments=("$input" -o "$folder/$1.h5" --resume --check --quiet) said
  add_overrides "$2"
  said=$("$program" "${arguments[@]}" 2>&1 </dev/null) || [[ $said == *"$is_finished"* ]]
}

# check_member K: reports if the program refuses the settings of member run K. Other problems are only noted by --dry-run.
check_member() {
  local arguments=("$input" --check --quiet) status=0 reason
  add_overrides "${overrides[$1]}"
  reason=$("$program" "${arguments[@]}" 2>&1 </dev/null) || status=$?
  ((status != 2)) || die "member ${names[$1]} cannot run: ${reason##*$'\n'}"
  [[ -z $dry ]] || ((status == 0)) || printf '%s: note: member %s cannot run yet: %s\n' "$me" "${names[$1]}" "${reason##*$'\n'}" >&2
}

# find_kind OVERRIDES: stores in `kind` what members that differ only in their seed have in common.
find_kind() {
  kind="kind $1 "
  while [[ $kind =~ ^(.*)'--set run.seed='[^\ ]*' '(.*)$ ]]; do kind=${BASH_REMATCH[1]}${BASH_REMATCH[2]}; done
}

# Checks each value of a variable, except seeds, in the first member run that uses it, before anything is written.
check_settings() {
  local k kind pair fresh arguments
  local -A seen=()
  for k in "${!names[@]}"; do
    find_kind "${overrides[k]}"
    if [[ -n ${seen[$kind]:-} ]] || is_done "${names[k]}"; then continue; fi
    fresh=$((${#seen[@]} == 0)) arguments=() seen[$kind]=1
    add_overrides "${overrides[k]}"
    for pair in "${arguments[@]}"; do
      [[ $pair == run.seed=* || -n ${seen[$pair]:-} ]] || fresh=1
      seen[$pair]=1
    done
    ((fresh == 0)) || check_member "$k"
  done
}

has_failed() {
  local last_line
  [[ ! -e $folder/$1.h5 ]] || return
  read_last_line "$1"
  [[ ! $last_line =~ $goes_on ]]
}

# Opens the log file of a member run for appending, and stores its file descriptor in `lock`. Fails unless the log is an
# ordinary file with a single hard link. Also fails if the log was replaced after it was opened.
open_log() {
  may_be_ours "$1" && { exec {lock}>>"$1"; } 2>/dev/null || return
  [[ ! -L $1 && $1 -ef /dev/fd/$lock && $(stat -L -c %h "/dev/fd/$lock") == 1 ]] && return
  exec {lock}>&-
  return 1
}

# Appends an empty line to the log file of the member run NAME, so that its last line is not attributed to the next attempt.
forget_failure() {
  local lock
  has_failed "$1" && open_log "$folder/$1.log" || return 0
  echo >&"$lock"
  exec {lock}>&-
}

# Checks that no earlier command in this folder used the same names of member runs with other settings, because a result is
# identified only by the name of its member run.
remember() {
  local line name k door='' changed='' mended='' extended=() found=()
  local -A before=() linked=()
  if { exec {door}<"$folder"; } 2>/dev/null; then # only one command at a time, if the file system supports locks
    flock -w 60 -E 75 "$door" 2>/dev/null || (($? != 75)) ||
      fail 3 "$folder is locked by another command: try again later"
  fi
  for name in input.nml manifest.txt; do check_ordinary "$folder/$name"; done
  while IFS= read -r -d '' name; do
    linked[x$name]=1
  done < <(find "$folder/" -maxdepth 1 -name '*.log' -links +1 -printf '%f\0' 2>/dev/null)
  if [[ -e $folder/manifest.txt ]]; then
    while IFS= read -r line; do before[x${line%%$'\t'*}]=${line#*$'\t'}; done <"$folder/manifest.txt"
  fi
  [[ -e $folder/input.nml ]] || found=("${names[@]}") # runs from elsewhere are left as they are
  if [[ -e $folder/input.nml ]] && ! cmp -s -- "$input" "$folder/input.nml"; then
    [[ -e $folder/manifest.txt ]] ||
      fail 3 "$folder/input.nml is not the input of an ensemble: choose another folder"
    mended=1
    for name in "${!before[@]}"; do
      has_data "${name#x}" || continue
      may_continue "${name#x}" "${before[$name]}" ||
        die "$folder holds members of another input, or of $input before a change (see $folder/input.nml):" \
          "choose another folder, or remove this one"
      break
    done
  fi
  for k in "${!names[@]}"; do
    name=${names[k]}
    check_ordinary "$folder/$name.log"
    [[ ! -e $folder/$name.log || -n ${before[x$name]+known} && -z ${linked[x$name.log]:-} ]] ||
      fail 3 "$folder/$name.log is not a log of this ensemble: remove it, or choose another folder"
    if [[ ${before[x$name]-${overrides[k]}} != "${overrides[k]}" ]] && has_data "$name"; then
      may_continue "$name" "${overrides[k]}" ||
        die "$folder holds a member '$name' with other settings (${before[x$name]}):" \
          "choose another folder or name"
      extended+=("$name")
    fi
    [[ ${before[x$name]-none} == "${overrides[k]}" ]] || changed=1
    [[ -z $mended && ${before[x$name]-${overrides[k]}} == "${overrides[k]}" ]] || forget_failure "$name"
    before[x$name]=${overrides[k]}
  done
  cmp -s -- "$input" "$folder/input.nml" || put "$folder/input.nml" <"$input"
  [[ -z $changed ]] ||
    for name in "${!before[@]}"; do printf '%s\t%s\n' "${name#x}" "${before[$name]}"; done | sort |
    put "$folder/manifest.txt" || exit 3
  for name in "${found[@]}"; do
    [[ ! -e $folder/$name.h5 || -e $folder/$name.h5.part ]] || touch -- "$folder/$name.h5"
  done
  # While a .part file exists, the modification time of the output file is preserved, because the program that extends this file
  # identifies it by this time.
  for name in "${extended[@]}"; do
    [[ ! -e $folder/$name.h5 || -e $folder/$name.h5.part ]] || touch -d @1 -- "$folder/$name.h5"
  done
  [[ -z $door ]] || exec {door}<&-
}
