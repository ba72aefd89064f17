#!/usr/bin/env bash

# Prints the path of the HDF5 compiler for Fortran (h5fc) that the Makefile uses. The script takes the first h5fc on PATH, or
# otherwise /usr/bin/h5fc, with which a program that uses HDF5 compiles and runs. The h5fc of a conda environment, for example, can
# name a compiler that is not installed. If no h5fc works, the script prints "h5fc" and its exit status is 1.
set -u
mapfile -t candidates < <(type -ap h5fc)
# The h5fc of the system is not tested, because the test takes as long as everything else that make does before it compiles.
case ${candidates[0]:-} in /usr/bin/h5fc | /bin/h5fc) echo h5fc && exit ;; esac
folder=$(mktemp -d) || exit
trap 'rm -rf -- "$folder"' EXIT
printf 'use hdf5\ninteger :: status\ncall h5open_f(status)\nend\n' >"$folder/test.f90"
for candidate in "${candidates[@]}" /usr/bin/h5fc; do
  if [[ -x $candidate ]] && (cd "$folder" && "$candidate" test.f90 -o test && ./test) >/dev/null 2>&1; then
    echo "$candidate" && exit
  fi
done
echo h5fc
exit 1
