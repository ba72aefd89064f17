#!/usr/bin/env bash

# The random Lorentz gas: diffusion of one tracer among 100 000 randomly placed, possibly overlapping scatterers, at six densities,
# compared with kinetic theory. Environment variables: N, the number of scatterers (for example N=1000000), and EVENTS, the number
# of events of each run (for example EVENTS=10000000).
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"
scatterers=${N:-100000} events=${EVENTS:-1000000} tracer=0.1 # the radii are 0.1 (tracer) and 0.9 (scatterers), so that R = 1

replace "$data/lorentz.nml" <<NML
! One tracer among random scatterers; each member sets the file, the size of the box and the frames.
&run
  title = 'random Lorentz gas'
/
&box
  boundary = 'periodic', 'periodic'
/
&obstacle
  name = 'scatterers'
  file = 'scatterers.txt'
/
&species
  name = 'tracer'
  count = 1
  radius = $tracer
  speed = 1
/
&stop
  events = $events
/
&output
  frames_every_time = 1
/
NML

# Frames are ten mean free times apart; the mean free time is 1/(2 n R v).
for density in 0.0025 0.005 0.01 0.02 0.04 0.08; do
  for seed in 1 2 3 4; do
    file=$data/scatterers_${scatterers}_${density}_$seed.txt
    [[ -e $file ]] || "$python" post/scatterers.py "$scatterers" "$density" --seed "$seed" -o "$file" >&2
    printf 'n_%s_%s\t--set run.seed=%s --set obstacle.scatterers.file=%s' "$density" "$seed" "$seed" "$file"
    awk -v n="$density" -v number="$scatterers" 'BEGIN { side = sqrt(number/n)
      printf " --set box.upper=%.17g,%.17g --set output.frames_every_time=%.17g\n", side, side, 5/n }'
  done
done | replace "$data/members.txt"
runs/ensemble.sh "$data/lorentz.nml" -d "$data/runs" --manifest "$data/members.txt" "$@"
"$python" post/lorentz.py "$data"/runs/n_*.h5 -o "$figures/lorentz.png" --csv "$figures/lorentz.csv"
"$python" post/trajectory.py "$data/runs/n_0.01_1.h5" --frames :300 -o "$figures/lorentz_path.png"
