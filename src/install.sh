#!/usr/bin/env bash

# The actions of `make install`, `make uninstall` and `make dist`.
# usage: src/install.sh install|uninstall|dist    environment: PREFIX, DESTDIR, BUILD
set -euo pipefail
((BASH_VERSINFO[0]*100 + BASH_VERSINFO[1] >= 404)) || { echo "bash 4.4 or newer is needed, this is $BASH_VERSION" >&2; exit 2; }
cd "$(dirname "$0")/.."
action=$1 build=${BUILD:-build} root=${DESTDIR:-}$PREFIX

# All names of installed files are relative to $root. The file $list contains the names of all installed files, one per line. This
# script removes or replaces only files whose names are in $list.
shared=share/ricochet
list=$shared/installed
documents=share/doc/ricochet
manuals=share/man/man1
version=$(sed -n 's/.*program_version = "\(.*\)"/\1/p' src/base/version.f90)
module=share/modulefiles/ricochet/$version
package=$shared/post/ricochet
completions=share/bash-completion/completions

# Source of each installed file: a path, or "-> TARGET" for a symbolic link. The source is empty for files that this
# script generates.
declare -A behind
plan() {
  local text command
  behind=([bin/ricochet]=$build/ricochet [bin/ricochet-ensemble]="-> ../$shared/runs/ensemble.sh"
    [$completions/ricochet]=docs/ricochet-completion.bash [$completions/ricochet-ensemble]='-> ricochet'
    [$manuals/ricochet.1]='' [$manuals/ricochet-ensemble.1]='' [$module]='' [include/ricochet.h]=src/ricochet.h
    [$shared/post/requirements.txt]=requirements.txt)
  for text in LICENSE README.md CHANGELOG.md CITATION.cff docs/*.{md,png} docs/*/*.{md,png,ipynb} docs/reference/input/*.md; do behind[$documents/$text]=$text; done
  behind[$documents/input]="-> ../../ricochet/input" # pages lead there
  for text in runs/ensemble{,_folder}.sh input/*.* input/pictures/* post/*.* post/ricochet/{,*/,*/*/}*.* post/page/*.*; do behind[$shared/$text]=$text; done
  for text in libricochet.so libricochet_files.so; do
    [[ -e $build/$text ]] || continue # made by make library
    behind[$package/lib/$text]=$build/$text
    behind[lib/$text]="-> ../$package/lib/$text"
  done
  for text in post/*.py; do
    command=ricochet-$(basename "$text" .py)
    behind[bin/${command//_/-}]="-> ../$shared/post/ricochet/commands.py"
  done
}

give_up() { echo "$action: $*" >&2; exit 2; }
[[ $PREFIX == /?* && ${DESTDIR:-/} == /* ]] ||
  give_up "PREFIX=$PREFIX, DESTDIR=${DESTDIR:-}: write folders that begin with /"

# SOURCE NAME
put() {
  local mode=644
  [[ ! -x $1 ]] || mode=755
  [[ -d $root/${2%/*} ]] || mkdir -p "$root/${2%/*}"
  if [[ $1 == '-> '* ]]; then ln -sfn "${1#-> }" "$root/$2"; else install -T -m $mode "$1" "$root/$2"; fi
}

# Removes the files whose names are read from standard input, the compiled Python files (*.pyc) that belong to them, and folders of
# the installation that have become empty.
remove() {
  local name folder
  while read -r name; do
    folder=$root/${name%/*}
    if [[ $name == *.py ]]; then
      rm -f "$folder/__pycache__/$(basename "$name" .py)".*.pyc
      rmdir "$folder/__pycache__" 2>/dev/null || true
    fi
    [[ -d $root/$name && ! -L $root/$name ]] || rm -f "$root/$name"
    while [[ ${folder#"$root/"}/ == @($shared|$documents)/* ]] && rmdir "$folder" 2>/dev/null; do folder=${folder%/*}; done
  done
}

case $action in
install)
  newer=$(find src \( -name '*.f90' -o -name '*.c' \) ! -name 'library*.f90' -newer "$build/ricochet" -print -quit)
  [[ -z $newer ]] || give_up "$build/ricochet is older than $newer; run make first, with the options that it was built with"
  umask 022 # all users read it, whoever installs
  mkdir -p "$root" 2>/dev/null || true
  [[ -w $root ]] || give_up "cannot write to $root; PREFIX=folder takes another, such as PREFIX=$HOME/.local"
  plan
  now=$(printf '%s\n' "${!behind[@]}" | sort)
  if [[ -e $root/$list ]]; then
    before=$(sort "$root/$list")
  elif [[ -d $root/$shared/post/ricochet ]]; then
    before=$now
    echo "an earlier install has left no list: what this one does not replace in $root/$shared stays"
  else
    before=
  fi
  while read -r name; do
    [[ ! -e $root/$name && ! -L $root/$name ]] || give_up "$root/$name is there, and no install has listed it; move it away"
  done < <(comm -13 <(echo "$before") <(echo "$now"))
  mkdir -p "$root/$shared"
  sort -u <<<"$before${before:+$'\n'}$now" >"$root/$list" # if this install is cut short the next one knows of both

  for name in "${!behind[@]}"; do [[ -z ${behind[$name]} ]] || put "${behind[$name]}" "$name"; done
  mkdir -p "$root/$manuals"
  for command in ricochet ricochet-ensemble; do
    python3 -B docs/manual_page.py "$root/bin/$command" "$PREFIX" >"$root/$manuals/$command.1" ||
      give_up 'python3 is needed for the manual pages'
  done
  mkdir -p "$root/${module%/*}"
  cat >"$root/$module" <<MODULE
#%Module1.0
module-whatis "Ricochet $version: event-driven simulation of hard disks"
conflict ricochet
prepend-path PATH {$PREFIX/bin}
prepend-path MANPATH {$PREFIX/share/man}
prepend-path PYTHONPATH {$PREFIX/$shared/post}
MODULE
  comm -23 <(echo "$before") <(echo "$now") | remove # files of an earlier version
  echo "$now" >"$root/$list"
  echo "installed: $root/bin/ricochet; ricochet-player and the other scripts; inputs in $root/$shared; pages in $root/$documents; man ricochet"
  if [[ $PREFIX != "${HOME:-/root}"/* ]] && grep -q -e '-march=native' "$build/flags" 2>/dev/null; then
    echo "install: $build/ricochet is for processors like the one of this machine; for all: make ARCH=x86-64-v3 all library install" >&2
  fi
  ;;
uninstall)
  [[ -e $root/$list ]] || give_up "$root/$list, the list of what was installed, is not there: nothing is removed"
  [[ -w $root/$shared ]] || give_up "cannot write to $root/$shared"
  names=$(cat "$root/$list")
  printf '%s\n' "$names" "$list" | remove
  ;;
dist)
  name=ricochet-$version
  git rev-parse --show-toplevel 2>/dev/null | grep -qx "$(pwd -P)" || give_up 'only a git clone can make a release'
  [[ -z $(git status --porcelain) ]] || give_up 'commit your changes first: a release holds what is committed'
  mkdir -p "$build"
  git archive --format=tar.gz --prefix="$name/" -o "$build/$name.tar.gz" HEAD
  echo "$build/$name.tar.gz"
  ;;
esac
