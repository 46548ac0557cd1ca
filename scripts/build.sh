#!/usr/bin/env bash
# Configures and builds everything, optimised, into build/. Many sources are compiled as one, which takes half the time.
# For work on the sources see CONTRIBUTING.md.
#   scripts/build.sh [TARGET…]     only these, as pliant: the program alone; a later call continues from there
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=Release -D PLIANT_WERROR=$werror "${joined[@]}"
targets=()
(($# == 0)) || targets=(--target "$@")
cmake --build "$build" --parallel "$cores" "${targets[@]}"
