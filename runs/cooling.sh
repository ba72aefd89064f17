#!/usr/bin/env bash
# S4: kinetic energies of the mixture for restitution 1, 0.9, 0.8; eight seeds, both wall rules.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

runs/ensemble.sh input/cooling.nml -d "$data" --scan contact.wall_rule=velocity,normal \
  --scan contact.restitution=1,0.9,0.8 --seeds 1-8 "$@"
for rule in velocity normal; do
  "$python" post/cooling.py "$data/wall_rule_$rule"_*.h5 \
    -o "$figures/cooling_$rule.png" --csv "$figures/cooling_$rule.csv"
done
