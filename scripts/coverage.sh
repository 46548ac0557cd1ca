#!/usr/bin/env bash
# Builds tests with counters of lines and branches, runs them, and prints the coverage of each folder of src/: by the unit
# tests alone, and together with the tests of the program (tests/apps) and of the Python module (tests/python).
#   scripts/coverage.sh [PROGRAM…]
#     PROGRAM   folders of tests/, like io; then only these run. NO_RANKS=1 leaves out the tests that start mpiexec
# Kernels are compiled once, not once per instruction set.
# Branches that only exceptions of the library take are not counted. Needs the Debian package gcovr.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

build=$root/build-coverage
names=("$@")
command -v gcovr >/dev/null || die "gcovr is not there: apt-get install gcovr"
"$root/scripts/setup.sh"
cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=Debug -D CMAKE_CXX_FLAGS="--coverage -O1 -DPLIANT_ONE_VERSION" \
  -D CMAKE_CXX_FLAGS_DEBUG= "${joined[@]}"
find "$build" -name '*.gcda' -delete

excluded=()
[[ ${NO_RANKS:-} == 1 ]] && excluded=(--exclude-regex '_ranks$')
run_tests() {
  ctest --test-dir "$build" --output-on-failure --parallel "$((cores + 1))" --tests-regex "$1" "${excluded[@]}" ||
    say "some tests failed, see above"
}

# print_coverage FILE: counters so far, as a table and as JSON.
print_coverage() {
  gcovr --root "$root" --filter "$root/src/" --object-directory "$build" --exclude-throw-branches \
    --exclude-unreachable-branches --gcov-ignore-parse-errors --json-summary "$1" "$build"
  /usr/bin/python3 - "$1" <<'EOF'
import collections
import json
import sys

folders = collections.defaultdict(collections.Counter)
for file in json.load(open(sys.argv[1], encoding="utf-8"))["files"]:
    name = "/".join(file["filename"].split("/")[1:-1])
    for key in ("line_covered", "line_total", "branch_covered", "branch_total"):
        folders[name][key] += file[key]
        folders["all of src"][key] += file[key]
print(f"{'folder':24} {'lines':>16} {'branches':>16}")
for name, c in folders.items():
    share = [f"{c[k + '_covered']}/{c[k + '_total']} {c[k + '_covered'] / max(c[k + '_total'], 1):5.1%}"
             for k in ("line", "branch")]
    print(f"{name:24} {share[0]:>16} {share[1]:>16}")
EOF
}

if ((${#names[@]} > 0)); then
  cmake --build "$build" --parallel "$cores" --target "${names[@]/#/test_}"
  for name in "${names[@]}"; do "$build/tests/test_$name"; done
  print_coverage "$build/coverage.json"
else
  read -ra names <"$build/tests/folders.txt"
  cmake --build "$build" --parallel "$cores" --target all
  run_tests "^($(IFS='|'; printf '%s' "${names[*]}"))(_ranks)?\$"
  say "unit tests"
  print_coverage "$build/coverage-unit.json"
  run_tests "^(apps|python)_"
  say "unit tests, tests/apps and tests/python"
  print_coverage "$build/coverage.json"
fi
