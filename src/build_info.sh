#!/bin/sh

# Writes a Fortran module that describes how the program was built (commit, compiler and flags), for `--version`.
# The arguments are the compiler flags.

# shellcheck disable=SC2016 # `make dist` puts the commit here
commit='$Format:%h$'
case $commit in
*Format*)
  commit=$(git describe --always --abbrev=12 --exclude='*' 2>/dev/null || echo unknown)
  [ -z "$(git status --porcelain -- src Makefile 2>/dev/null)" ] || commit=$commit+changes
  ;;
esac
cat <<END
!> The commit and the flags that this program was built from. Written by src/build_info.sh.
module build_info
  implicit none
  private
  public :: git_commit, build_flags
  character(len=*), parameter :: git_commit = "$commit"
  character(len=*), parameter :: build_flags = "$1" &
END
shift
for flag; do echo "    // \" $flag\" &"; done
echo '    // ""'
echo 'end module build_info'
