#!/usr/bin/env bash
# Writes the reference of the public headers into build-doxygen/html by doxygen (apt-get install doxygen). Fails if a comment
# is not valid. Without doxygen nothing is written, and the exit code is 77.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

if ! command -v doxygen >/dev/null; then
  say "doxygen is not installed (apt-get install doxygen); the comments of the headers are not checked"
  exit 77
fi
cd "$root"
mkdir -p build-doxygen
PLIANT_VERSION=$(sed -n 's/^project(pliant VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
export PLIANT_VERSION
doxygen Doxyfile
