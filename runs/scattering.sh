#!/usr/bin/env bash

# Exam, problem 1: scattering angle of a light disk that collides with a heavy disk, for 81 impact parameters b/R12 between -1.2 and
# 1.2.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

# The light disk starts at the height 0.5 + b; the sum of the radii is R12 = 0.1 + 0.001.
for k in {-40..40}; do
  awk -v k="$k" 'BEGIN {
    s = 1.2 * k / 40
    printf "b_%.2f\t--set species.light.position=0.2,%.17g\n", s, 0.5 + 0.101 * s }'
done | replace "$data/members.txt"

runs/ensemble.sh input/scattering.nml -d "$data" --manifest "$data/members.txt" "$@"
"$python" post/scattering.py "$data"/*.h5 -o "$figures/scattering.png" --csv "$figures/scattering.csv"
