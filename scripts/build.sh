#!/usr/bin/env bash
# Configures and builds everything, optimised, into build/.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=Release -D PLIANT_WERROR=$werror
cmake --build "$build" --parallel "$cores"
