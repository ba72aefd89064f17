#!/usr/bin/env bash

# Prints the path of the HDF5 compiler for Fortran (h5fc) for the Makefile. The candidates are all h5fc on PATH,
# followed by /usr/bin/h5fc. The script prints the first candidate with which an HDF5 program compiles and runs. The
# h5fc of a conda environment, for example, may call a compiler that is not installed. If no h5fc works, the script
# prints "h5fc" and exits with status 1.
set -u
mapfile -t candidates < <(type -ap h5fc)
# The h5fc of the system is not tested. The test would double the time that passes before make
# starts to compile.
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
