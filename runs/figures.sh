#!/usr/bin/env bash

# Draws the figures of all systems, and writes runs/figures/index.html, which shows all of them.
#
# Examples of calls:
#
#   runs/figures.sh                 draws the figures of all systems
#   runs/figures.sh gas crater      draws the figures of two systems
#   runs/figures.sh -j 4 gas        passes the option -j 4 to ensemble.sh
. "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"
known=(scattering gas mixture cooling crater lab cost billiards lorentz gravity state stages melting driven hopper)

options=()
while [[ ${1:-} == -* ]]; do
  options+=("$1" "${2:?"$1 needs a value"}")
  shift 2
done
(($# > 0)) || set -- "${known[@]}"

failed=()
for system; do
  [[ " ${known[*]} " == *" $system "* ]] || {
    printf 'figures.sh: unknown system %s; known: %s\n' "$system" "${known[*]}" >&2
    exit 2
  }
  printf '== %s\n' "$system" >&2
  status=0
  "runs/$system.sh" "${options[@]}" || status=$?
  case $status in
  0) ;;
  75 | 130 | 143) exit 75 ;; # stopped on request; the same command continues
  *) failed+=("$system (exit $status)") ;;
  esac
done

# Writes a section of the page for each existing figure, with its name, its title, and the script that draws it.
section() {
  local name=$1 title=$2 script=$3 file
  for file in "$name".{png,mp4,gif}; do
    [[ -e $figures/$file ]] || continue
    printf '<figure id="%s">\n' "$name"
    if [[ $file == *.mp4 ]]; then
      printf '<video src="%s" controls loop muted preload="metadata"></video>\n' "$file"
    else
      printf '<a href="%s"><img src="%s" alt="%s" loading="lazy"></a>\n' "$file" "$file" "$title"
    fi
    printf '<figcaption><b>%s</b> <code>runs/%s.sh</code>' "$title" "$script"
    [[ ! -e $figures/$name.csv ]] || printf ' <a href="%s.csv">numbers</a>' "$name"
    [[ ! -e $figures/$name.html ]] || printf ' <a href="%s.html">interactive film</a>' "$name"
    printf '</figcaption>\n</figure>\n'
    return
  done
}

{
  cat <<'HTML'
<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Ricochet: figures</title>
<style>
  body { font: 16px/1.4 system-ui, sans-serif; margin: 2rem; }
  main { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 34rem), 1fr)); gap: 2rem; }
  figure { margin: 0; }
  img, video { width: 100%; height: 30rem; object-fit: contain; object-position: left top; background: white; }
</style>
<h1>Ricochet: figures</h1>
<main>
HTML
  section scattering 'Scattering angle against impact parameter' scattering
  section gas_frames 'A gas: first and last frame' gas
  section gas 'A gas: speeds from equal to Maxwellian' gas
  section gas_film 'A gas, film: the first collisions' gas
  section mixture 'A mixture: speeds and energies' mixture
  section cooling_velocity 'Cooling; walls slow both components' cooling
  section cooling_normal 'Cooling; walls slow the normal component' cooling
  section crater 'A crater' crater
  section crater_film 'A crater, film' crater
  section crater_scan 'Crater size against four parameters' crater
  section lab_frames '10 x 10 disks on a grid: events 0, 50, 100, 300' lab
  section lab_speeds '10 x 10 disks: speeds' lab
  section lab_film '10 x 10 disks: event by event' lab
  section lab_masses 'The lab with different masses' lab
  section lab_masses_speeds 'The lab with different masses: speeds' lab
  section cost 'Cost of a collision' cost
  section billiards 'Billiards: Sinai, Lorentz' billiards
  section lyapunov 'Sinai billiard: divergence of neighbouring trajectories' billiards
  section container 'A round container' billiards
  section container_film 'A round container, film' billiards
  section brownian 'Brownian motion' billiards
  section lorentz 'Random Lorentz gas: diffusion' lorentz
  section lorentz_path 'Random Lorentz gas: a path' lorentz
  section gravity_energy 'Gravity: energies, time steps and events' gravity
  section gravity_missed 'Gravity: collisions that time steps miss' gravity
  section gravity_equipartition 'Gravity: equipartition' gravity
  section gravity_laws 'Gravity: speeds and heights' gravity
  section gravity_frames 'Gravity: frames' gravity
  section gravity_film 'Gravity, film' gravity
  section equation_of_state 'Bulk: equation of state' state
  section correlations 'Bulk: time correlations, diffusion, order' state
  section rates 'Bulk: pressure against time, free paths' state
  section haff 'Bulk: cooling and the law of Haff' state
  section stages 'Stages: compressed and relaxed' stages
  section stages_expanded 'Stages: cooled, heated, expanded' stages
  section melting 'Melting: pressure against packing fraction' melting
  section melting_0.698 'Bond orientation at packing fraction 0.698' melting
  section melting_0.708 'Bond orientation at packing fraction 0.708' melting
  section melting_0.72 'Bond orientation at packing fraction 0.720' melting
  section fourier 'Heat conduction between a hot and a cold wall' driven
  section couette 'A gas between sliding walls' driven
  section rough 'Rough disks: translational and rotational temperature' driven
  section leidenfrost 'Leidenfrost effect: a dense layer above a hot dilute layer' driven
  section leidenfrost_fields 'Leidenfrost: density and temperature above the floor' driven
  section demon "Maxwell's demon: grains gather in one of two chambers" driven
  section nut 'The Brazil nut: a large disk rises in a shaken bed' driven
  section compression 'Compression heats a gas along its adiabat' driven
  section constant_pressure 'A free piston: width at constant enthalpy' driven
  section heated 'A granular gas with white-noise driving' driven
  section active 'Active disks form clusters' driven
  section transport 'Bulk: viscosity, conductivity, diffusion' driven
  section discharge 'A refilled hopper: discharge rate and the law of Beverloo' hopper
  section hopper 'A hopper that is refilled' hopper
  section drum 'A rotating drum' hopper
  section intruder 'A dragged intruder' hopper
  section stirrer 'A stirrer of constant speed' hopper
  section coverage 'Bulk: coverage of error bars' coverage
  printf '</main>\n</html>\n'
} | replace "$figures/index.html"
printf 'figures = %s/index.html\n' "$figures"

if ((${#failed[@]} > 0)); then
  printf 'figures.sh: failed: %s\n' "${failed[@]}" >&2
  exit 1
fi
