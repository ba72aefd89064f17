#!/usr/bin/env bash

# Coverage of the error bars, the fraction of them that contain the true value, from 200 short runs each of a gas, of a liquid,
# and of a liquid near freezing.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

while read -r packing placement; do
  runs/ensemble.sh input/bulk.nml -d "$data/eta_$packing" --seeds 1-200 \
    --set "species.disks.packing_fraction=$packing" --set "species.disks.placement=$placement" "$@"
done <<'TABLE'
0.3 random
0.6 dense
0.68 dense
TABLE
"$python" post/coverage.py "$data"/eta_*/*.h5 -o "$figures/coverage.png" \
  --csv "$figures/coverage.csv"
