#!/usr/bin/env bash
# Runs clang-tidy (.clang-tidy) over src/ and apps/: the sources of a folder as one, which reads their headers once.
#   scripts/tidy.sh [FOLDER…]     FOLDER: of src/, like io; all unless given
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

build=$root/build-tidy
command -v clang-tidy-14 >/dev/null || die "clang-tidy-14 is not there (apt-get install clang-tidy-14)"
cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=Release -D CMAKE_EXPORT_COMPILE_COMMANDS=ON \
  -D PLIANT_BUILD_TESTS=OFF -D PLIANT_BUILD_EXAMPLES=OFF -D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=0 >/dev/null
cmake --build "$build" --target pliant_version >/dev/null

mapfile -t sources < <(sed -n 's/^  "file": "\(.*\)"$/\1/p' "$build/compile_commands.json" | sort -u)
if (($# > 0)); then
  wanted=()
  for folder in "$@"; do
    [[ -d $root/src/$folder ]] || die "src/$folder is not there"
    for source in "${sources[@]}"; do
      [[ $source == */pliant_"$folder"?(_*).dir/* || $source == "$root/src/$folder"/* ]] && wanted+=("$source")
    done
  done
  sources=("${wanted[@]}")
fi
start=$SECONDS
# clang-tidy prints the number of suppressed warnings to the standard error.
if ! printf '%s\0' "${sources[@]}" | xargs -0 -n 1 -P "$cores" clang-tidy-14 --quiet -p "$build" 2>"$build/clang-tidy.log"; then
  grep -v 'warnings generated\|warnings treated as errors' "$build/clang-tidy.log" >&2 || true
  die "clang-tidy has findings, see above"
fi
say "clang-tidy: no findings in ${#sources[@]} sources, $((SECONDS - start)) s"
