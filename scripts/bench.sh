#!/usr/bin/env bash
# Builds with benchmarks and times everything: whole runs against their targets and LAMMPS, scaling, threads and ranks,
# flow rates, kernels. Writes the tables of docs/performance.md, docs/performance-data/*.csv and
# docs/images/performance-*.webp.
#   scripts/bench.sh [--quick] [--only PART]... [--repetitions N] [--output FOLDER] [--cpu CORE]
# --quick is a smoke test: small, once, into build/bench. PLIANT_BUILD names a build folder that is to be used as it is.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [[ -z ${PLIANT_BUILD:-} ]]; then
  "$root/scripts/setup.sh" --benchmarks
  cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=Release -D PLIANT_BUILD_BENCHMARKS=ON
  cmake --build "$build" --parallel "$cores"
fi
exec /usr/bin/python3 "$root/benchmarks/bench.py" --build "${PLIANT_BUILD:-$build}" "$@"
