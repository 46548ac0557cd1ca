#!/usr/bin/env bash
# Installs the package of scripts/deb.sh in a bare Debian 12 without compiler (debootstrap) and uses it there: program, Python,
# report, movie, installed examples. Prints the seconds of each. Takes about ten minutes; needs root and debootstrap. Keeps the
# bare Debian 12 in build/bare-base for the next time.
#   scripts/bare.sh [PACKAGE.deb]     default: build/deb/pliant_*.deb
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

((EUID == 0)) || die "debootstrap and chroot need root; run it as root"
command -v debootstrap >/dev/null || die "debootstrap is missing; apt install debootstrap"
package=${1:-$(echo "$build"/deb/pliant_*.deb)}
[[ -e $package ]] || die "$package does not exist; run scripts/deb.sh first"
bare=$build/bare
suite=bookworm

# The mirror and the proxy of this machine.
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' "Release: $suite" | head -n 1)
[[ -n $mirror ]] || die "apt has no source for $suite; run it on Debian 12"
http_proxy=$(apt-config shell proxy Acquire::http::Proxy | sed "s/^proxy='\(.*\)'$/\1/")
[[ -z $http_proxy ]] || export http_proxy

unmount() {
  local folder
  for folder in dev proc sys; do
    if mountpoint -q "$bare/$folder"; then umount --recursive "$bare/$folder"; fi
  done
}
trap unmount EXIT

timed() {  # description, command …: its seconds; its output, if it fails
  local start=${EPOCHREALTIME/[.,]/} log
  if ! log=$("${@:2}" 2>&1); then
    printf '%s\n' "$log" | tail -n 30 >&2
    die "$1: failed"
  fi
  printf '%6.1f s  %s\n' "$(((${EPOCHREALTIME/[.,]/} - start) / 100000))e-1" "$1"
}
inside() { chroot "$bare" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
  OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 ${http_proxy:+http_proxy="$http_proxy"} sh -c "cd /root && $1"; }

unmount
rm -rf --one-file-system "$bare"
mkdir -p "$build"
if [[ ! -d $bare-base ]]; then
  rm -rf --one-file-system "$bare-partial"
  timed "debootstrap" debootstrap --variant=minbase "$suite" "$bare-partial" "$mirror"
  mv "$bare-partial" "$bare-base"
fi
cp -a "$bare-base" "$bare"
mount -t proc proc "$bare/proc"
mount -t sysfs -o ro sysfs "$bare/sys"
mount --rbind /dev "$bare/dev"
mount --make-rslave "$bare/dev"
for file in hosts resolv.conf; do
  if [[ -e /etc/$file ]]; then cp -L "/etc/$file" "$bare/etc/$file"; fi
done
cp "$package" "$bare/root/"
# Without recommended packages, except ffmpeg for the movie.
timed "apt install" inside "apt-get -qq update && apt-get -qq install -y --no-install-recommends ./$(basename "$package") ffmpeg"
# Debian's python3-scipy depends on a compiler, through python3-pythran. Pliant works without.
inside 'rm -f /usr/bin/*gcc* /usr/bin/*g++* /usr/bin/cc /usr/bin/c++'
say "$(du -shx "$bare" | cut -f 1) on the disk"

start=$SECONDS
examples=/usr/share/pliant/examples
timed "pliant -version" inside "pliant -version"
timed "pliant -help" inside "pliant -help"
timed "hopper" inside "pliant hopper -n 200 -hopper_wall_distance 15 -hopper_width 5 -zeta 0.3 -t_end 20 -frame_interval 0.2 -output runs/first"
timed "report" inside "pliant-report runs/first && test -s runs/first/report.html"
timed "movie" inside "pliant-plot movie runs/first -o first.mp4 && test -s first.mp4"
say "first movie and report after $((SECONDS - start)) s"
timed "figure" inside "pliant-plot series runs/first -o series.png && test -s series.png"
timed "pliant.Simulation" inside "python3 -c '
import numpy as np, pliant
walls = pliant.Walls()
walls.line([(-3, 6), (-3, 0), (3, 0), (3, 6)])
x = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(1, 4)), axis=-1).reshape(-1, 2)
sim = pliant.Simulation(x, diameters=0.9, walls=walls, gravity=(0, -1), zeta=0.3)
sim.run(20)
assert len(sim.contacts) and abs(sim.positions[:, 1].min() - 0.45) < 0.01  # disks at rest on the floor
run = pliant.hopper(n=60, hopper_wall_distance=8, hopper_width=3, t_end=1, output=\"runs/python\", quiet=True)
assert run.summary[\"status\"] == \"done\"'"
timed "sweep" inside "cp $examples/widths.csv . && pliant-sweep widths.csv && pliant-plot beverloo widths/results.csv -o beverloo.png"
timed "pliant-reproduce" inside "pliant-reproduce --help && pliant-analyse --help"
# Each options file briefly, with the command in its comment; each Python example as it is.
brief() {
  case $1 in
    hopper) echo "-n 60 -t_end 0.02" ;;
    raft) echo "-t_end 1" ;;
    channel) echo "-t_end 0.01" ;;
  esac
}
for file in "$bare$examples"/*.yaml; do
  scenario=$(sed -n 's/^# pliant \([a-z]*\) -options_file .*/\1/p' "$file" | head -n 1)
  name=$(basename "$file")
  timed "$name" inside "pliant $scenario -options_file $examples/$name $(brief "$scenario") -output runs/${name%.yaml}"
done
for file in $(cd "$bare$examples" && find . -name '*.py' | sort); do
  timed "$file" inside "mkdir -p python && cd python && python3 $examples/$file"
done
