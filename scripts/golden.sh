#!/usr/bin/env bash
# Builds two commits and compares the files of short runs of all kinds, bit for bit. For changes that must not alter
# numbers; the table names the first value that differs. Exits with 1 if anything does.
#   scripts/golden.sh [--except CASE]... [--only CASE]... REF [OTHER]
#     REF, OTHER   commits; OTHER: the working tree if it is left out
#     --except     differs on purpose: is run and shown, but does not count
#     --only       runs this case alone
# Builds of commits are kept in build-golden/ for the next time, the build of the working tree in build-golden-tree/.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

usage="usage: scripts/golden.sh [--except CASE]... [--only CASE]... REF [OTHER]"
golden=$root/build-golden
options=()
commits=()
while (($# > 0)); do
  case $1 in
    --except | --only)
      (($# > 1)) || die "$1 needs the name of a case; $usage"
      options+=("$1" "$2")
      shift
      ;;
    -*) die "unknown argument $1; $usage" ;;
    *) commits+=("$1") ;;
  esac
  shift
done
((${#commits[@]} == 1 || ${#commits[@]} == 2)) || die "$usage"

build_program() {  # source folder, build folder: the program alone
  local log=$2/golden.log
  mkdir -p "$2"
  say "Building ${2#"$root"/}"
  {
    cmake -S "$1" -B "$2" -G Ninja -D CMAKE_BUILD_TYPE=Release -D PLIANT_WERROR="$werror" -D PLIANT_BUILD_TESTS=OFF \
      -D PLIANT_BUILD_EXAMPLES=OFF &&
      CCACHE_BASEDIR=$1 cmake --build "$2" --parallel "$cores" --target pliant
  } >"$log" 2>&1 || {
    tail -n 20 "$log" >&2
    die "the build failed; $log has all of it"
  }
}

# Each build folder lies right in its sources, so that ccache, if it is used, shares results between them.
programs=()
for commit in "${commits[@]}"; do
  hash=$(git -C "$root" rev-parse --quiet --verify --short=12 "$commit^{commit}") || die "$commit is no commit"
  source=$golden/$hash
  if [[ ! -e $source/CMakeLists.txt ]]; then
    rm -rf "$source"
    git clone --quiet --shared --no-checkout "$root" "$source"
    git -C "$source" checkout --quiet --detach "$hash"
  fi
  build_program "$source" "$source/build"
  programs+=("$source/build/apps/pliant")
done
if ((${#commits[@]} == 1)); then
  build_program "$root" "$root/build-golden-tree"
  commits+=("the working tree")
  programs+=("$root/build-golden-tree/apps/pliant")
fi
exec /usr/bin/python3 -B "$root/scripts/golden.py" "${options[@]}" --folder "$golden/runs" --jobs "$cores" \
  --names "${commits[@]}" --programs "${programs[@]}"
