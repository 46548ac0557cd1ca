#!/usr/bin/env bash
# Installs the missing packages that Pliant needs (Debian 12: by apt-get, as root or with sudo).
#   scripts/setup.sh [--benchmarks]     --benchmarks: also packages for scripts/bench.sh and work-precision.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

packages=(
  g++ cmake ninja-build pkg-config
  petsc-dev slepc-dev libsundials-dev libopenmpi-dev libhdf5-openmpi-dev zlib1g-dev libyaml-dev libeigen3-dev libfmt-dev nlohmann-json3-dev catch2
  python3 python3-numpy python3-scipy python3-matplotlib python3-pandas python3-h5py python3-lmfit
  python3-uncertainties python3-pytest python3-tqdm pybind11-dev python3-dev ffmpeg
)
if [[ ${CI:-} == true ]]; then
  packages+=(clang-format clang-14 clang-tidy-14 libclang-rt-14-dev libomp-14-dev libbenchmark-dev mypy
    python3-petsc4py chromium-headless-shell libeatmydata1)
fi
benchmarks=no
case ${1:-} in
  "") ;;
  --benchmarks)
    benchmarks=yes
    packages+=(libbenchmark-dev lammps util-linux)
    ;;
  *) die "unknown argument $1; usage: scripts/setup.sh [--benchmarks]" ;;
esac

installed() { dpkg-query -W -f='${db:Status-Status}\n' "$1" 2>/dev/null | grep -qx installed; }

# Without apt-get nothing can be installed from here, but the tools may be there under other names.
check_tools() {
  local missing=() tool module
  for tool in c++ cmake ninja pkg-config mpicc ffmpeg; do
    command -v "$tool" >/dev/null || missing+=("$tool")
  done
  for module in PETSc SLEPc yaml-0.1; do
    pkg-config --exists "$module" 2>/dev/null || missing+=("pkg-config:$module")
  done
  if [[ $benchmarks == yes ]]; then
    command -v taskset >/dev/null || missing+=(taskset)
    command -v lmp >/dev/null || say "lmp (LAMMPS) is not there: its rows will be left out."
  fi
  for module in numpy scipy matplotlib pandas h5py lmfit pytest; do
    python3 -c "import $module" 2>/dev/null || missing+=("python3:$module")
  done
  say "This is not Debian or a relative of it. Pliant needs, by their Debian names:"
  say "  ${packages[*]}"
  ((${#missing[@]} == 0)) || die "not found: ${missing[*]}; install them and run this again"
  say "The tools are there; going on."
}

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  check_tools
  exit 0
fi

missing=()
for package in "${packages[@]}"; do
  installed "$package" || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  exit 0
fi

as_root=()
if ((EUID != 0)); then
  command -v sudo >/dev/null || die "missing packages: ${missing[*]}; install them as root (there is no sudo here)"
  as_root=(sudo)
fi
apt() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 "$@" </dev/null; }
say "Installing with apt-get: ${missing[*]}"
apt update
# update-alternatives complains of manual pages that small images leave out. Packages whose installation fails are told
# of by dpkg and apt themselves, whose status this is.
apt install -y --no-install-recommends "${missing[@]}" 2>&1 >/dev/null |
  { grep -v '^update-alternatives: error: ' || true; } >&2
say "Installed."
