# Completion for bash:  source docs/ricochet-completion.bash
# Completes options, input files, variables for --set, --scan and --explain, and their values; all of it comes
# from the program itself.

# "run.title" "run.seed" ...: every variable, those of groups with names also by the names in FILE.
_ricochet_variables() { # program, input file or nothing
  local group
  "$1" --print-defaults 2>/dev/null | sed -n 's/^\(! \)*&\([a-z]*\).*/\2/p' | while read -r group; do
    "$1" --explain "$group" 2>/dev/null | sed -n 's/^\([a-z]\{1,\}\.[a-z_]\{1,\}\).*/\1/p'
  done | awk -v file="$2" '
    BEGIN {
      quote = sprintf("%c", 39)
      while (file != "" && (getline line < file) > 0) {
        sub(/!.*/, "", line)
        if (match(line, /&[a-z]+/)) group = substr(line, RSTART + 1, RLENGTH - 1)
        if (line !~ /^[ \t]*name[ \t]*=/) continue
        split(line, part, "[" quote "\"]")
        names[group] = names[group] " " part[2]
      }
    }
    {
      split($1, part, ".")
      if (part[1] in names) {
        n = split(names[part[1]], name, " ")
        for (k = 1; k <= n; k++) print part[1] "." name[k] "." part[2]
      } else print $1
    }'
}

# The values of a variable that has a list of choices.
_ricochet_values() { # program, variable
  local variable=${2%%(*}
  if [[ $variable == *.*.* ]]; then variable=${variable%%.*}.${variable##*.}; fi
  "$1" --explain "$variable" 2>/dev/null | grep allowed: | grep -oE "'[a-z_]+'|\.(true|false)\." | tr -d "'"
}

# "box.gravity(1)=" "box.gravity(2)=": the elements of a vector of fixed size that begin with WORD.
_ricochet_elements() { # program, WORD
  local count k
  count=$("$1" --explain "$2" 2>/dev/null | sed -n 's/^ *allowed: \([0-9]\{1,\}\) .*/\1/p' | head -n 1)
  for ((k = 1; k <= ${count:-0}; k++)); do
    if [[ "${2%%(*}($k)" == "$2"* ]]; then echo "${2%%(*}($k)="; fi
  done
}

_ricochet() {
  local command=${COMP_WORDS[0]} program word before input='' k options variable
  program=${command%-ensemble} # the variables are those of the program that the members run
  program=${program/%runs\/ensemble.sh/build\/ricochet}
  # "--set run.queue=he" may arrive as one word or as three, as COMP_WORDBREAKS has it.
  word=${COMP_WORDS[COMP_CWORD]}
  k=$COMP_CWORD
  variable=''
  if [[ $word == '=' ]]; then
    variable=${COMP_WORDS[k - 1]} word='' k=$((k - 1))
  elif ((k > 1)) && [[ ${COMP_WORDS[k - 1]} == '=' ]]; then
    variable=${COMP_WORDS[k - 2]} k=$((k - 2))
  fi
  before=${COMP_WORDS[k - 1]}
  for k in "${COMP_WORDS[@]:1}"; do
    if [[ $k == *.nml ]]; then input=$k; fi
  done
  COMPREPLY=()
  case $before in
  --set | --scan)
    if [[ -n $variable ]]; then
      mapfile -t COMPREPLY < <(compgen -W "$(_ricochet_values "$program" "$variable")" -- "$word")
    elif [[ $word == *'('* ]]; then
      mapfile -t COMPREPLY < <(_ricochet_elements "$program" "${word#[\'\"]}")
      compopt -o nospace 2>/dev/null
    else
      mapfile -t COMPREPLY < <(compgen -S = -W "$(_ricochet_variables "$program" "$input")" -- "$word")
      compopt -o nospace 2>/dev/null
    fi
    ;;
  --explain)
    options=$(_ricochet_variables "$program" '' | awk -F . '{ print $0, $1, $2 }')
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$word" | sort -u)
    ;;
  -o | --output)
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
    compopt -o filenames 2>/dev/null
    ;;
  *)
    options=$("$command" --help 2>/dev/null | grep -oE '(^|[ ,|])--?[a-z][a-z-]*' | tr -d ' ,|' | sort -u)
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$word")
    if [[ $word != -* ]]; then
      mapfile -t COMPREPLY < <(compgen -f -X '!*.nml' -- "$word"; compgen -d -- "$word")
      compopt -o filenames 2>/dev/null
    fi
    ;;
  esac
}

complete -F _ricochet ricochet ricochet-ensemble runs/ensemble.sh # the last is that of a clone
