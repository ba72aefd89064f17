#!/usr/bin/env bash
# Melting: pressure against packing fraction, and pictures of the order of the bonds.
#
# 64^2 and 128^2 disks, from crystals, briefly: some minutes. Between 0.70 and 0.72 they have not quite
# molten by then: the pressure is too low, errors are large, and warnings say so. With FULL=1 long
# runs, and 256^2 disks: some 40 hours of processor time in all.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

if [[ -n ${FULL:-} ]]; then
  lengths='64 1000000 128 500000 256 200000' data=$data/full
else
  lengths='64 10000 128 2000'
fi
points=0.68,0.69,0.698,0.702,0.705,0.708,0.712,0.716,0.72,0.73
read -ra pairs <<<"$lengths"
for ((k = 0; k < ${#pairs[@]}; k += 2)); do
  side=${pairs[k]} count=$((pairs[k] ** 2))
  runs/ensemble.sh input/bulk.nml -d "$data/$side" --set species.disks.placement=lattice \
    --set "species.disks.count=$count" --set box.upper=1,0.8660254037844386 \
    --set "stop.collisions_per_disk=${pairs[k + 1]}" \
    --set "output.observables_every_collisions=$((5 * count))" \
    --scan "species.disks.packing_fraction=$points" "$@"
done
"$python" post/melting.py "$data"/*/*.h5 -o "$figures/melting.png" --csv "$figures/melting.csv"
for packing in 0.698 0.708 0.72; do
  "$python" post/snapshot.py "$data/$side"/*"packing_fraction_$packing"*.h5 --colour psi6 \
    -o "$figures/melting_$packing.png"
done
