#!/usr/bin/env bash

# Exam, problem 5: pictures of one crater, and crater size as a function of mass, speed and radius of the projectile and of the
# restitution.
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

# Each parameter is varied over ten values, with eight beds (seeds) for each, while the other three keep their standard values:
# mass 25, speed 5, radius 5 and restitution 0.5. Since hard disks have no energy scale, the crater does not depend on the
# speed. A constant contact time (TC model) would introduce such a scale. The contact time is therefore proportional to 1/speed.
member() { # mass speed radius restitution seed
  local contact_time
  contact_time=$(awk -v v="$2" 'BEGIN { printf "%.17g", 5e-5 / v }')
  printf 'mass_%s_speed_%s_radius_%s_restitution_%s_seed_%s\t' "$@"
  printf -- '--set species.projectile.mass=%s --set species.projectile.velocity=0,-%s ' "$1" "$2"
  printf -- '--set species.projectile.radius=%s --set contact.restitution=%s ' "$3" "$4"
  printf -- '--set run.seed=%s --set contact.contact_time=%s\n' "$5" "$contact_time"
}
for seed in {1..8}; do
  for mass in 2.5 5 7.5 10 12.5 15 17.5 20 22.5 25; do member "$mass" 5 5 0.5 "$seed"; done
  for speed in 1 2 3 4 5 6 7 8 9 10; do member 25 "$speed" 5 0.5 "$seed"; done
  for radius in 1 2 3 4 5 6 7 8 9 10; do member 25 5 "$radius" 0.5 "$seed"; done
  for restitution in 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 0.9 0.95; do
    member 25 5 5 "$restitution" "$seed"
  done
done | sort -u | replace "$data/members.txt"

runs/ensemble.sh input/crater.nml -d "$data/one" --seeds 1 \
  --set output.frames_every_time=0.002 --set output.observables_every_time=0.001 \
  --set output.event_log=.true. "$@"
"$python" post/crater.py "$data/one/seed_1.h5" -o "$figures/crater.png"
"$python" post/animate.py "$data/one/seed_1.h5" --colour speed -o "$figures/crater_film"
"$python" post/player.py "$data/one/seed_1.h5" --colour displacement -o "$figures/crater_film.html"

runs/ensemble.sh input/crater.nml -d "$data" --manifest "$data/members.txt" "$@"
"$python" post/crater_scan.py "$data"/*.h5 -o "$figures/crater_scan.png" \
  --csv "$figures/crater_scan.csv"
