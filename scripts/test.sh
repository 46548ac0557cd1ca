#!/usr/bin/env bash
# Installs what is missing, builds, and runs all tests. Arguments go to ctest, e.g. scripts/test.sh -R model
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

"$root/scripts/setup.sh"
"$root/scripts/build.sh"
exec ctest --test-dir "$build" --output-on-failure --parallel "$cores" "$@"
