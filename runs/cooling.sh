#!/usr/bin/env bash

# Exam, problem 4: kinetic energies of a mixture with coefficients of restitution 1, 0.9 and 0.8, and with elastic or inelastic
# walls; eight seeds each.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

runs/ensemble.sh input/cooling.nml -d "$data" --scan contact.wall_rule=velocity,normal \
  --scan contact.restitution=1,0.9,0.8 --seeds 1-8 "$@"
for rule in velocity normal; do
  "$python" post/cooling.py "$data/wall_rule_$rule"_*.h5 \
    -o "$figures/cooling_$rule.png" --csv "$figures/cooling_$rule.csv"
done
