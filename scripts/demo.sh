#!/usr/bin/env bash
# Hopper flows of soft, rough and smooth particles: installs missing packages, builds, runs each model at several orifice
# widths, fits the flow rates and leaves pictures and a movie in demo/, which is replaced each time.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

"$root/scripts/setup.sh"
say "Building the program, which takes about $((7 / cores + 1)) minutes on $cores core(s) (without tests, which scripts/build.sh adds)."
"$root/scripts/build.sh" pliant

cd "$root"
plots=python/plots
rm -rf demo

# Moderate stiffnesses and few vertices, for steps of 2e-4 to 1e-3 t0: minutes instead of hours. All systems share them;
# energy is dissipated either by the drag of a fluid around the particles, or by friction between them.
common="-n 320 -hopper_wall_distance 20 -e_w 500"
shape="$common -e_c 500 -k_a 1000 -k_l 100 -n_vertices 12"
drag="-zeta 0.316227766"
friction="-mu 1"
declare -A options=(
  [rough-friction]="-model rough $shape $friction -t_end 80"
  [smooth-drag]="-model smooth $shape -edge_width 0.3 $drag -t_end 40 -dt 2.5e-4"
  [soft-friction]="-model sp $common -e_sp 100 $friction -t_end 200"
  [soft-drag]="-model sp $common -e_sp 100 $drag -t_end 200"
)
soft=(soft-friction soft-drag)
polygons=(rough-friction smooth-drag) # slow runs first, so that no core ends with a long run

run() {  # folder, options …: one line when it is done, the program's message when it fails
  local folder=$1 log=$1.log result
  shift
  mkdir -p "$(dirname "$folder")"
  if ! "$build/apps/pliant" hopper "$@" -output "$folder" >"$log" 2>&1; then
    tail -n 1 "$log" >&2
    return 255 # xargs stops
  fi
  result=$(grep -E '^(Q =|clogged)' "$log" | tail -n 1)
  say "  ${folder#demo/}: $result"
}
export -f run say
export build

sweep() {  # widths, systems …: lines for run, these widths of each
  local widths=$1 system width
  shift
  for system in "$@"; do
    for width in $widths; do
      say "demo/$system/w$width ${options[$system]} -hopper_width $width -frame_interval 30"
    done
  done
}
all() { xargs -P "$cores" -L 1 bash -c 'run "$@"' run; }

say "Running five orifice widths of soft particles with friction, and with drag, on $cores core(s); about $((20 / cores + 5)) s:"
sweep 6 "${soft[@]}" | all
$plots/snapshot.py --panels demo/{soft-friction,soft-drag}/w6 -o demo/soft.png
sweep "3 4 5 8" "${soft[@]}" | all

say "The same of rough and smooth polygons, and a movie; about $((170 / cores + 20)) s:"
{
  sweep "3 4 5 6 8" "${polygons[@]}"
  say "demo/film ${options[smooth-drag]} -hopper_width 4 -t_end 15 -frame_interval 0.1"
} | all

say "Drawing:"
$plots/snapshot.py --panels demo/{smooth-drag,rough-friction,soft-drag}/w6 -o demo/flow.png
$plots/movie.py demo/film -o demo/flow.mp4
$plots/beverloo.py demo/{rough-friction,smooth-drag,soft-friction,soft-drag} -o demo/beverloo.png
