#!/usr/bin/env bash
# Builds Debian packages of the working tree: build/deb/pliant_VERSION_ARCH.deb, libpliant-dev and pliant-doc. Checks them
# with lintian, if that is installed. Uses ccache, if that is installed.
#   scripts/deb.sh [CMAKE-ARGUMENT…]
# Needs debhelper and dh-python in addition to scripts/setup.sh.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

command -v dh dh_python3 >/dev/null || die "debhelper or dh-python is missing; apt install debhelper dh-python"
launcher=()  # without SOURCE_DATE_EPOCH, a part of ccache's keys that no source uses
if command -v ccache >/dev/null; then
  for language in C CXX; do
    launcher+=("'-DCMAKE_${language}_COMPILER_LAUNCHER=env;-u;SOURCE_DATE_EPOCH;ccache'")
  done
fi
source=$build/deb/source
rm -rf "$build/deb"
mkdir -p "$source"
cd "$root"
git ls-files -z | tar --null --files-from=- --create | tar --extract --directory "$source"

cd "$source"
start=$SECONDS
if ! CONFIGURE="${launcher[*]} $*" dpkg-buildpackage --build=binary --no-sign --jobs="$cores" >"$build/deb/log" 2>&1; then
  tail -n 20 "$build/deb/log" >&2
  die "dpkg-buildpackage failed; $build/deb/log has its output"
fi
say "built in $((SECONDS - start)) s:"
cd "$build/deb"
ls -sh ./*.deb
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error,warning --tag-display-limit 0 ./*.changes
  say "lintian: no errors, no warnings"
fi
