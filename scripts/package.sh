#!/usr/bin/env bash
# Installs the build of scripts/build.sh into build/package and uses it there: programs, figures, and example programs that
# are compiled against it. Takes a minute.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

[[ -e $build/apps/pliant ]] || die "$build has no program; run scripts/build.sh first"
exec cmake -D "BUILD=$build" -D "WORK=$build/package" -D GENERATOR=Ninja -P "$root/tests/install.cmake"
