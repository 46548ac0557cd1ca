#!/usr/bin/env bash
# Builds with benchmarks and measures the cost of integrators for a given error. Writes the tables of
# docs/validation/integrators.md, docs/performance-data/work-precision-*.csv and docs/images/work-precision-*.webp.
#   scripts/work-precision.sh [--quick] [--only PROBLEM]... [--output FOLDER] [--cpu CORE]
# --quick is a smoke test: small, once, into build/work-precision. PLIANT_BUILD names a build folder that is to be used
# as it is.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if [[ -z ${PLIANT_BUILD:-} ]]; then
  "$root/scripts/setup.sh" --benchmarks
  cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=Release -D PLIANT_BUILD_BENCHMARKS=ON
  cmake --build "$build" --parallel "$cores" --target pliant pliant_work_precision
fi
exec /usr/bin/python3 "$root/benchmarks/work_precision.py" --build "${PLIANT_BUILD:-$build}" "$@"
