#!/usr/bin/env bash

# Executes the member runs of a sweep on all cores: one for each combination of seeds and values of variables. After an
# interruption, the same command continues the sweep.
set -euo pipefail
me=${0##*/}
((BASH_VERSINFO[0]*100 + BASH_VERSINFO[1] >= 404)) || { echo "bash 4.4 or newer is needed, this is $BASH_VERSION" >&2; exit 2; }
export OMP_NUM_THREADS=1 # one core per member run, unless run.threads is set

usage() {
  cat <<TEXT
$me: performs many runs of one input (seeds x values), and continues after an interruption

usage:  $me INPUT.nml -d FOLDER [option]...

members:
  --seeds LIST           run.seed of each member: 1-8 or 1,5,9 or 1-4,11
  --scan VARIABLE=A,B,C  values of a variable; several options combine all their values.  Vectors
                         contain commas and are therefore separated by semicolons:
                         --scan 'species.ball.velocity=0,-1;0,-2'
                         An element of a vector: --scan 'box.gravity(2)=-5,-10'
  --set VARIABLE=VALUE   value of a variable in all members; may be repeated
  --manifest FILE        list of members, instead of --seeds and --scan; one member per line:
                             NAME <TAB or blank> --set VARIABLE=VALUE --set VARIABLE=VALUE ...
                         (a NAME with blanks needs the TAB; lines that begin with # are left out)
running:
  -j N                   number of members that run at the same time [number of cores]
  --dry-run              print the members, check the input of the first, and stop
  --engine pool          this script runs the members on this machine [default],
           slurm         a Slurm job array, -j N members at a time in all; sbatch takes its options
                         from the environment: SBATCH_TIMELIMIT, SBATCH_PARTITION, ...
           parallel      GNU parallel, -j N members at a time on each host
  --tasks N              largest number of tasks of the Slurm array, which share the members [10 for
                         each of -j N, within the limits of the site]
  --retry                submit members that failed to Slurm once more
  --sshloginfile FILE    hosts for GNU parallel, as in its manual [this machine]
  --share K/M            run only the K-th of M parts of the list (used by the engines)
  -h, --help

Member NAME writes FOLDER/NAME.h5 and FOLDER/NAME.log.  The same command again continues: a finished
member (with NAME.h5) is left out, a member with NAME.h5.part resumes, and a member that failed or
was interrupted without data starts again (with Slurm only with --retry).  With a later stop or
another sampling schedule it extends finished members.  TERM or Ctrl-C stops all members after a
checkpoint.  Copies of the command on one folder share the work.  The program is
that of RICOCHET, or ricochet in the folder of this command (in a clone build/ricochet).  All
machines need the same folders.

exit:   0 all members finished; 1 some members failed; 2 wrong usage or input; 3 the folder
        cannot be used; 75 stopped, the same command continues
TEXT
}

# fail CODE TEXT...: prints a one-line error message and exits with the status CODE.
fail() {
  local code=$1
  shift
  if [[ -n ${task:-} ]]; then tell "$me" "${*//[[:cntrl:]]/?}"; else printf '%s: %s\n' "$me" "${*//[[:cntrl:]]/?}" >&2; fi
  exit "$code"
}

die() { fail 2 "$@"; }

# nearest WORD CHOICE...: prints a suggestion such as "; did you mean --seeds?" if WORD resembles one of the choices, or nothing
# without Python.
nearest() {
  python3 -c 'import difflib, sys
for near in difflib.get_close_matches(sys.argv[1], sys.argv[2:], 1): print(f"; did you mean {near}?")' \
    "$@" 2>/dev/null || true
}

# --- member runs: two arrays hold their names and their overrides ("--set A=B --set C=D") ---

most=100000
names=()
overrides=()

# Adds the seeds to the scanned variables; the argument 1-4,11, for example, adds run.seed=1,2,3,4,11.
scan_seeds() {
  local part first last parts list=()
  mapfile -t -d , parts < <(printf '%s,' "$1")
  for part in "${parts[@]}"; do
    first=1 last=0
    if [[ $part =~ ^(0|[1-9][0-9]{0,9})(-(0|[1-9][0-9]{0,9}))?$ ]]; then
      first=${BASH_REMATCH[1]} last=${BASH_REMATCH[3]:-${BASH_REMATCH[1]}}
    fi
    [[ -z ${BASH_REMATCH[2]:-} ]] || ((first <= last)) || die "--seeds $1: in '$part' the first seed exceeds the last"
    ((first <= last)) ||
      die "--seeds $1: '$part' is neither a number nor a range such as 1-8 (no leading zeros)"
    ((${#list[@]} + last - first < most)) || die "--seeds $1: more than $most members"
    for (( ; first <= last; first++)); do list+=("$first"); done
  done
  printf -v list '%s,' "${list[@]}"
  scans+=("run.seed=${list%,}")
}

# Adds a member run for every combination of values of the scanned variables and seeds, with the first scanned variable varying
# slowest. The name of a member run consists of the values of the scanned variables, without blanks and slashes: ball.mass_5
# stands for species.ball.mass=5, and gravity_2_-5 for box.gravity(2)=-5.
generate_members() {
  local scan variable list values separator value k short old_names old_overrides known=' '
  names=("") overrides=("")
  for scan in "${scans[@]}"; do
    [[ $scan == *.*=?* ]] || die "--scan $scan: write GROUP.VARIABLE=VALUE,VALUE,..., as in contact.restitution=0.8,0.9"
    variable=${scan%%=*} list=${scan#*=} separator=,
    [[ $known != *" $variable "* ]] || die "--scan $variable: is given twice (--seeds is run.seed)"
    known+="$variable "
    [[ $list == *';'* ]] && separator=';'
    mapfile -t -d "$separator" values < <(printf '%s' "$list")
    short=${variable#species.}
    [[ $short == *.*.* || $variable == species.* ]] || short=${short#*.}
    short=${short/(/_} short=${short/)/}
    ((${#names[@]} * ${#values[@]} <= most)) || die "--scan $variable: more than $most members"
    old_names=("${names[@]}") old_overrides=("${overrides[@]}")
    names=() overrides=()
    for k in "${!old_names[@]}"; do
      for value in "${values[@]}"; do
        names+=("${old_names[k]:+${old_names[k]}_}${short}_${value//[^A-Za-z0-9.+-]/_}")
        overrides+=("${old_overrides[k]:+${old_overrides[k]} }--set $variable=$value")
      done
    done
  done
}

# Reads the names and the overrides (options --set) of member runs from standard input, in the format of a manifest.
read_manifest() {
  local line rest
  while IFS= read -r line || [[ -n $line ]]; do
    line=${line%$'\r'}
    [[ $line =~ ^[[:blank:]]*(#|$) ]] && continue
    if [[ $line == *$'\t'* ]]; then
      names+=("${line%%$'\t'*}") rest=${line#*$'\t'}
    else
      line=${line#"${line%%[![:blank:]]*}"}
      names+=("${line%% *}") rest=${line#"${line%% *}"}
    fi
    rest=${rest//$'\t'/ }
    rest=${rest#"${rest%%[![:blank:]]*}"}
    rest=${rest%"${rest##*[![:blank:]]}"}
    [[ -z $rest || $rest == '--set '* ]] ||
      die "$manifest: member '${names[-1]}': '$rest' does not begin with --set"
    overrides+=("$rest")
    ((${#names[@]} <= most)) || die "$manifest: more than $most members"
  done
}

check_names() {
  local -A seen=()
  local name
  for name in "${names[@]}"; do
    [[ -n $name && ${#name} -le 200 && $name != *[/[:cntrl:]]* && $name != [-.[:blank:]]* &&
      $name != *[[:blank:]] ]] ||
      die "'$name' cannot name a member: up to 200 characters, not empty, no slash," \
        "no dash or dot in front, no blanks around"
    [[ $name != parallel && $name != slurm ]] ||
      die "'$name' cannot name a member: $name.log is a file of the engine"
    [[ -z ${seen[x$name]:-} ]] || die "two members have the name '$name': give --scan values that differ, and separate vectors by semicolons"
    seen[x$name]=1
  done
}

# --- worker processes, which execute the member runs ---

# Appends the overrides of a member run to the array `arguments`. A quoted value may contain the text ' --set '.
add_overrides() {
  local rest=$1 pair quotes more
  while [[ $rest == '--set '* ]]; do
    rest=${rest#--set }
    pair=${rest%% --set *}
    while [[ $pair == *"='"* && $pair != "$rest" ]]; do
      quotes=${pair//[!\']/}
      ((${#quotes} % 2)) || break
      more=${rest#"$pair --set "}
      pair+=" --set ${more%% --set *}"
    done
    arguments+=(--set "$pair")
    rest=${rest#"$pair"}
    rest=${rest# }
  done
}

# Executes the member run k, and reports the result to the parent process through the pipe.
run_member() {
  local base=$folder/${names[$1]} status resume='' said
  said=$(last_words "${names[$1]}")
  local arguments=("$input" -o "$base.h5" --quiet)
  add_overrides "${overrides[$1]}"
  [[ -z $said ]] || echo >&"$lock" # separates this attempt from an earlier one
  [[ ! -e $base.h5.part && ! -e $base.h5 ]] || resume=--resume
  while :; do
    "$program" "${arguments[@]}" $resume >"/dev/fd/$lock" 2>&1 </dev/null {events}>&- &
    child=$!
    [[ -z $stopping ]] || kill -TERM "$child" 2>/dev/null || true # the signal arrived earlier
    while :; do # `wait` also ends when a signal arrives
      interrupted='' status=0
      wait "$child" 2>/dev/null || status=$? # without bash's message about a killed process
      [[ -n $interrupted && ($status == 143 || $status == 130) ]] || break
    done
    child=
    [[ -n $resume && $(last_words "${names[$1]}") == *": its run broke off "* ]] || break
    resume= # start again from the beginning
  done
  # While the script is being stopped, a member run counts as stopped, too, if its exit status is negative or at least 127. Such
  # a member run was stopped during its start, or while bash waited for it a second time. The exit status -1 means that bash has
  # lost the exit status.
  if [[ -n $stopping ]] && ((status >= 127 || status < 0)); then status=75; fi
  if ((status == 3)) && [[ -e $base.h5 && $(last_words "${names[$1]}") == *"$is_finished"* ]]; then
    touch -- "$base.h5" && status=0
  fi
  ((status <= 128)) || tell_kill "$status" "$said" >&"$lock"
  reply "$1" "$status"
}

# Reports that a member run was killed, given its exit status and the message about earlier attempts. A member run that was
# killed three times is not started again, because it probably needs more memory or time.
tell_kill() {
  local how='' given_up=''
  [[ $1 != 137 ]] || how=' (out of memory?)'
  [[ $2 != 'killed by signal'*twice* ]] || given_up='given up after three attempts: '
  [[ $2 != 'killed by signal'* ]] || how+=', twice'
  printf '%skilled by signal %d%s, %(%FT%T%z)T on %s\n' "$given_up" "$(($1 - 128))" "$how" -1 "$host"
}

# reply MEMBER STATUS: tells the parent process how a member run ended.
reply() {
  printf '%s %s.\n' "$1" "$2" >&"$events"
}

# Executes all member runs that no other worker process, and no other call of this script, executes. A member run is reserved by a
# lock on its log file. The simulation program inherits the lock, which therefore exists as long as the program runs.
work() {
  local k base lock child='' stopping='' interrupted=''
  trap 'stopping=1 interrupted=1; [[ -z $child ]] || kill -TERM "$child" 2>/dev/null || true' TERM INT
  for k in "${!names[@]}"; do
    if [[ -n $stopping ]] || ! kill -0 $$ 2>/dev/null; then break; fi
    base=$folder/${names[k]}
    if is_done "${names[k]}" || ! mkdir "$claims/$k" 2>/dev/null; then continue; fi
    if ! open_log "$base.log"; then
      reply "$k" closed
      continue
    elif ! flock -n "$lock"; then
      reply "$k" busy
    elif is_done "${names[k]}"; then
      reply "$k" 0
    elif [[ -n $share ]] && has_failed "${names[k]}"; then
      reply "$k" 'failed before' # because this task was requeued
    else
      tell "${names[k]}" "$([[ -e $base.h5.part ]] && echo continues || echo begins)"
      run_member "$k"
    fi
    exec {lock}>&-
  done
  reply worker ends
}

# --- parent process: starts worker processes, forwards signals, and shows the progress ---

clock() {
  local s=$1
  if ((s >= 3600)); then
    printf '%d:%02d:%02d' $((s / 3600)) $((s / 60 % 60)) $((s % 60))
  else
    printf '%d:%02d' $((s / 60)) $((s % 60))
  fi
}

# tell MEMBER TEXT: prints a line about a member run, with its name, the time and the host. A line is printed only if this
# script executes a share of the member runs. Each share may be executed on another computer or at another time.
tell() {
  [[ -z $task ]] || printf '%(%FT%T%z)T %s %s %s: %s\n' -1 "$task" "$host" "$1" "$2" >&2
}

show_progress() {
  [[ -z $share ]] || return 0
  local now=$SECONDS done_now=$((finished - skipped)) left=$((total - finished - failed)) line
  line="$finished/$total members finished, $failed failed, $(clock "$now")"
  if ((done_now > 0 && left > 0)); then line+=", ETA $(clock $((now * left / done_now)))"; fi
  if [[ -t 2 ]]; then
    printf '\r%s\033[K' "$line" >&2
  elif ((now >= next_line)); then
    printf '%s\n' "$line" >&2
    next_line=$((now + 30))
  fi
}

forward() {
  stopped=1
  ((${#workers[@]} == 0)) || kill -TERM "${workers[@]}" 2>/dev/null || true
}

run_all() {
  local k status slot part message=''
  claims=$(mktemp -d 2>/dev/null) || fail 3 "cannot make a folder in ${TMPDIR:-/tmp}"
  trap 'rm -rf -- "$claims"' EXIT
  mkfifo "$claims/pipe"
  exec {events}<>"$claims/pipe"
  trap forward TERM INT HUP
  set -m # separate process groups: Ctrl-C reaches only this script, which sends one TERM to each member run
  for ((slot = 0; slot < jobs && slot < total; slot++)); do
    [[ -z $stopped ]] || break
    work &
    workers+=($!)
    [[ -z $stopped ]] || forward # the signal arrived earlier
  done
  set +m
  while ((ended < ${#workers[@]})); do
    # The second can end within a line, or when the line has been read: only its full stop shows that a reply is complete.
    if ! IFS= read -r -t 1 -u "$events" part && [[ -z $part ]]; then
      kill -0 "${workers[@]}" 2>/dev/null || break # all workers were killed
    fi
    message+=$part
    if [[ $message == *. ]]; then
      read -r k status <<<"${message%.}"
      message=''
      count_reply "$k" "$status"
    fi
    show_progress
  done
  wait
  [[ ! -t 2 ]] || printf '\r\033[K' >&2
}

count_reply() {
  case $2 in
  ends) ended=$((ended + 1)) ;;
  0) finished=$((finished + 1)) && tell "${names[$1]}" finished ;;
  75) tell "${names[$1]}" "$(last_words "${names[$1]}")" ;;
  busy) busy=$((busy + 1)) && tell "${names[$1]}" 'is run by another copy' ;;
  closed) failure "${names[$1]}" '' "cannot write $folder/${names[$1]}.log" ;;
  'failed before') failure "${names[$1]}" '' "$(last_words "${names[$1]}")" ;;
  *) failure "${names[$1]}" " (exit $2)" "$(last_words "${names[$1]}")" ;;
  esac
}

# failure MEMBER HOW REASON: counts a failed member run, and prints the reason of the failure.
failure() {
  failed=$((failed + 1))
  failures+=("$1$2: ${3:-no message in its log}")
  tell "$1" "failed$2: ${3:-no message in its log}"
}

# announce TEXT: prints TEXT with a summary of all member runs. If the script executes only a share of them, nothing is printed,
# because a line about each member run has already been printed.
announce() {
  [[ -z $share ]] || return 0
  printf '%s: %s%d of %d members finished' "$folder" "$1" "$finished" "$total" >&2
  ((skipped == 0)) || printf ', %d of them before' "$skipped" >&2
  printf ', %d failed, %s\n' "$failed" "$(clock "$SECONDS")" >&2
  ((failed == 0)) || printf '  failed: %s\n' "${failures[@]}" >&2
}

summarise() {
  finished=0
  for name in "${names[@]}"; do ! is_done "$name" || finished=$((finished + 1)); done
  announce "$1"
  ((failed == 0)) || exit 1
  ((finished < total)) || return 0
  [[ -n $share ]] || ((busy == 0)) || printf '  %d are run by another copy\n' "$busy" >&2
  [[ -n $share ]] || printf '  %sthe same command continues with the rest\n' "${stopped:+stopped: }" >&2
  exit 75
}

# --- engines (GNU parallel, Slurm): they start this script several times, each time for a share of the member runs ---

# Sets `shares`, the number M of shares into which the member runs are divided (at most the argument), and `share_command`, which
# executes share K of M when K/M is appended. Finished and failed member runs belong to no share.
prepare_shares() {
  local most=$1 k here left=0
  here=$(cd -- "$folder" && pwd)
  for k in "${!names[@]}"; do
    is_done "${names[k]}" || has_failed "${names[k]}" || printf '%s\t%s\n' "${names[k]}" "${overrides[k]}"
  done | put "$folder/left.txt" || exit 3
  left=$(wc -l <"$folder/left.txt")
  shares=$((left < most ? left : most))
  share_command=(env "RICOCHET=$(realpath -- "$program")" bash "$script" "$here/input.nml" -d "$here"
    --manifest "$here/left.txt" -j 1 --share)
}

# Determines from output files and log files which member runs have failed.
judge_by_files() {
  local name last_line
  for name in "${names[@]}"; do
    ! is_done "$name" || continue
    read_last_line "$name"
    [[ $last_line =~ $goes_on && $last_line != killed* ]] || failure "$name" '' "$last_line"
  done
}

# TERM must be delivered to the script itself. A shell that runs the script would terminate at once, and GNU parallel would treat
# the share as finished while the script continues.
run_parallel() {
  local options=(--will-cite -j "$jobs" --termseq 'TERM,600000') child=''
  command -v parallel >/dev/null || die "--engine parallel needs GNU parallel (package parallel)"
  for name in "${names[@]}"; do forget_failure "$name"; done
  prepare_shares 1000
  put "$folder/parallel.log" </dev/null
  [[ -z $hosts ]] || options+=(--sshloginfile "$hosts" --workdir "$PWD")
  [[ ! -t 2 ]] || options+=(--bar)
  trap 'stopped=1; [[ -z $child ]] || kill -TERM "$child" 2>/dev/null || true' TERM INT HUP
  parallel "${options[@]}" "exec $(printf '%q ' "${share_command[@]}"){}/$shares" < <(seq "$shares") 2>"$folder/parallel.log" &
  child=$!
  [[ -z $stopped ]] || kill -TERM "$child" 2>/dev/null || true # the signal arrived earlier
  while kill -0 "$child" 2>/dev/null; do wait "$child" || true; done
  [[ -z $stopped ]] || wait_for_locks
  judge_by_files
}

# Checks the input before jobs are submitted, so that an invalid input is not reported only after waiting in the queue. Of member
# runs that differ only in their seed, one is checked.
check_inputs() {
  local k kind reason arguments
  local -A seen=()
  for k in "${!names[@]}"; do
    find_kind "${overrides[k]}"
    if [[ -n ${seen[$kind]:-} ]] || is_done "${names[k]}" || has_failed "${names[k]}"; then continue; fi
    seen[$kind]=1 arguments=("$input" --check --quiet)
    add_overrides "${overrides[k]}"
    reason=$("$program" "${arguments[@]}" 2>&1 </dev/null) || failure "${names[k]}" " (exit $?)" "${reason##*$'\n'}"
  done
  ((failed == 0)) || summarise 'nothing is submitted: correct the members that failed, or leave them out: '
}

# Waits until the member runs on other computers have ended, which happens soon after the connection to these computers has ended.
wait_for_locks() {
  local name
  for name in "${names[@]}"; do
    [[ ! -e $folder/$name.h5.part ]] || ! may_be_ours "$folder/$name.log" ||
      flock --timeout 60 "$folder/$name.log" true || true
  done
}

# Submits a job array to Slurm. Each task of the array forwards TERM to its member runs. A task that reaches its time limit,
# without being cancelled, is requeued. A task identifies itself by the job number of the array and its own index, because the
# SLURM_JOB_ID of the last task equals the job number of the whole array.
submit_to_slurm() {
  local id='' here text site
  command -v sbatch >/dev/null || die "--engine slurm needs Slurm (no sbatch here)"
  here=$(cd -- "$folder" && pwd)
  check_ordinary "$folder/slurm.job"
  [[ ! -s $folder/slurm.job ]] || id=$(<"$folder/slurm.job")
  if [[ -n $id && -n $(squeue --noheader --array --jobs "$id" 2>/dev/null || true) ]]; then
    judge_by_files
    announce "Slurm job $id is not finished: "
    exit 75
  fi
  [[ -z $retry ]] || for name in "${names[@]}"; do forget_failure "$name"; done
  check_inputs
  judge_by_files
  site=$(scontrol show config 2>/dev/null | awk '$1 == "MaxArraySize" { print $3 - 1 }' || true) # largest index of a task
  [[ $site =~ ^[1-9][0-9]*$ ]] || site=1000
  : "${tasks:=$((10*jobs))}"
  prepare_shares "$((tasks < site ? tasks : site))"
  ((shares > 0)) || summarise 'only --retry runs these again: '
  check_ordinary "$folder/slurm.log"
  text="#!/usr/bin/env bash
trap 'stopped=1; [[ -z \$child ]] || kill -TERM \$child' TERM
stopped='' child=''
$(printf '%q ' "${share_command[@]}")\$SLURM_ARRAY_TASK_ID/$shares & child=\$!
[[ -z \$stopped ]] || kill -TERM \$child
status=143
while kill -0 \$child 2>/dev/null; do status=0; wait \$child || status=\$?; done
own=\${SLURM_ARRAY_JOB_ID}_\$SLURM_ARRAY_TASK_ID
if [[ \$status == 75 || -n \$stopped && \$status != 0 ]] && [[ \$(squeue --noheader --format=%T --jobs=\$own) == RUNNING ]]; then
  scontrol requeue \$own
fi
exit \$status"
  id=$(sbatch --parsable --array="1-$shares%$jobs" --requeue --signal=B:TERM@60 --open-mode=append \
    --job-name="${here##*/}" --output="$here/slurm.log" <<<"$text") || die "Slurm: sbatch refused the job, for the reason above"
  put "$folder/slurm.job" <<<"${id%%;*}"
  announce "Slurm job ${id%%;*} submitted, "
  printf '  the same command reports its progress\n' >&2
  exit 75
}

# --- options of the command line ---

trap 'fail 75 "stopped before any member ran"' TERM INT
unset CDPATH
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
script=$here/${BASH_SOURCE[0]##*/}
functions=$(dirname -- "$(realpath -- "${BASH_SOURCE[0]}")")/ensemble_folder.sh # in the folder of the file to which a link refers
[[ -r $functions ]] || die "cannot read $functions, which contains functions of $me: copy it to this place"
# shellcheck source=runs/ensemble_folder.sh
. "$functions"
input='' folder='' seeds='' manifest='' engine=pool hosts='' share='' dry='' tasks='' retry='' task='' jobs=$(nproc 2>/dev/null || echo 1)
common='' scans=() host=$(uname -n)
for word; do [[ $word != *[[:cntrl:]]* ]] || die "'$word' contains control characters"; done
while (($#)); do
  case $1 in
  -h | --help) usage && exit 0 ;;
  --dry-run) dry=1 && shift && continue ;;
  --retry) retry=1 && shift && continue ;;
  -d | -j | --seeds | --scan | --set | --manifest | --engine | --tasks | --sshloginfile | --share) (($# > 1)) || die "$1 needs a value" ;;
  -*)
    near=$(nearest "$1" --seeds --scan --set --manifest --engine --tasks --retry --sshloginfile --share --dry-run --help)
    die "unknown option $1${near:-, see --help}"
    ;;
  *)
    [[ -z $input ]] || die "only one input file is allowed, not '$input' and '$1'"
    input=$1 && shift && continue
    ;;
  esac
  case $1 in
  -d) folder=$2 ;;
  -j) jobs=$2 ;;
  --seeds) seeds=$2 ;;
  --scan) scans+=("$2") ;;
  --set) common+="${common:+ }--set $2" ;;
  --manifest) manifest=$2 ;;
  --engine) engine=$2 ;;
  --tasks) tasks=$2 ;;
  --sshloginfile) hosts=$2 ;;
  --share) share=$2 ;;
  esac
  shift 2
done

[[ -n $input ]] || die "no input file is given, see --help"
[[ -r $input && -f $input ]] || die "cannot read $input$(
  shopt -s nullglob
  nearest "$input" "${input%"${input##*/}"}"*.nml input/*.nml
)"
[[ -n $folder ]] || die "no folder for the members is given: -d FOLDER"
[[ $folder != -* ]] || folder=./$folder
[[ $jobs =~ ^[1-9][0-9]{0,5}$ ]] || die "-j $jobs: not a number of members"
[[ $engine =~ ^(pool|slurm|parallel)$ ]] || die "--engine $engine: unknown engine; allowed: pool, slurm or parallel"
[[ $tasks =~ ^(|[1-9][0-9]{0,5})$ ]] || die "--tasks $tasks: not a number of tasks"
[[ -z $tasks$retry || $engine == slurm ]] || die "--tasks and --retry need --engine slurm"
[[ -z $hosts || $engine == parallel ]] || die "--sshloginfile needs --engine parallel"
[[ -z $hosts || -f $hosts && -r $hosts ]] || die "cannot read $hosts, or it is not an ordinary file"
[[ $share =~ ^(|[1-9][0-9]{0,8}/[1-9][0-9]{0,8})$ ]] || die "--share $share: write K/M, such as 2/10"
if [[ -n $manifest ]]; then
  [[ -z $seeds && ${#scans[@]} == 0 ]] || die "--manifest cannot be combined with --seeds or --scan"
  [[ -f $manifest && -r $manifest ]] || die "cannot read $manifest, or it is not an ordinary file"
  if [[ -n $share ]]; then # each share reads only its own lines, because reading a long list takes seconds
    read_manifest < <(awk -v k="${share%/*}" -v m="${share#*/}" 'NR % m == k % m' "$manifest")
    ((${#names[@]} > 0)) || exit 0
  else
    read_manifest <"$manifest"
  fi
else
  [[ -n $seeds || ${#scans[@]} -gt 0 ]] || die "no members are given: use --seeds, --scan or --manifest"
  [[ -z $seeds ]] || scan_seeds "$seeds"
  generate_members
fi
((${#names[@]} > 0)) || die "${manifest:-the list of members}: contains no members"
check_names
for k in "${!overrides[@]}"; do
  overrides[k]=${common:+$common${overrides[k]:+ }}${overrides[k]}
done

# Share K of M consists of the member runs K, K + M, K + 2M, and so on; with a manifest, these are numbers of lines.
if [[ -n $share ]]; then
  task=${SLURM_ARRAY_JOB_ID:+${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID:-}}
  task=${task:-share $share}
  for k in "${!names[@]}"; do
    [[ -n $manifest ]] || (((k + 1 - ${share%/*}) % ${share#*/} == 0)) || unset "names[k]" "overrides[k]"
  done
  names=("${names[@]}") overrides=("${overrides[@]}")
  ((${#names[@]} > 0)) || exit 0
fi

program=${here%/*}/build/ricochet
[[ ! -x $here/ricochet ]] || program=$here/ricochet # installed in the same folder
program=${RICOCHET:-$program}
[[ -f $program && -x $program ]] || die "there is no program $program: run make, or set RICOCHET"
if [[ -n $dry ]]; then
  for k in "${!names[@]}"; do printf '%s\t%s\n' "${names[k]}" "${overrides[k]}"; done
  check_member 0
  exit 0 # an initial-configuration file may be produced by another sweep, and not exist yet
fi
command -v flock >/dev/null || die "the program flock is missing (package util-linux)"
[[ -n $share || $engine == slurm ]] || check_settings # Slurm: see check_inputs
reason=$(mkdir -p -- "$folder" 2>&1) || fail 3 "cannot make $folder: ${reason##*: }"
[[ -n $share ]] || remember

total=${#names[@]} finished=0 failed=0 busy=0 ended=0 next_line=30 stopped='' claims=''
workers=() failures=()
for name in "${names[@]}"; do ! is_done "$name" || finished=$((finished + 1)); done
skipped=$finished
if ((finished < total)); then
  [[ -w $folder ]] || fail 3 "cannot write into $folder"
  case $engine in
  pool) run_all ;;
  parallel) run_parallel ;;
  slurm) submit_to_slurm ;;
  esac
fi
summarise ''
