#!/usr/bin/env bash
# Installs missing packages, builds, and runs all tests. Arguments go to ctest, e.g. scripts/test.sh -R model
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

"$root/scripts/setup.sh"
"$root/scripts/build.sh"
# One more than there are cores: many tests wait. Tests that keep all cores busy run alone.
exec ctest --test-dir "$build" --output-on-failure --parallel "$((cores + 1))" "$@"
