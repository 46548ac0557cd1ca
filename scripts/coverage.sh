#!/usr/bin/env bash
# Builds tests with counters of lines and branches, runs them, and prints the coverage of each folder of src/.
#   scripts/coverage.sh [PROGRAM…]
#     PROGRAM   folders of tests/, like io; all of them and the tests of the program in tests/apps, unless given
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
if ((${#names[@]} > 0)); then
  cmake --build "$build" --parallel "$cores" --target "${names[@]/#/test_}"
  for name in "${names[@]}"; do "$build/tests/test_$name"; done
else
  read -ra names <"$build/tests/folders.txt"
  cmake --build "$build" --parallel "$cores" --target pliant own_scenario own_term \
    pliant_test_{disk,memory,handlers} "${names[@]/#/test_}"
  programs=$(IFS='|'; printf '%s' "${names[*]}")
  ctest --test-dir "$build" --output-on-failure --parallel "$((cores + 1))" --tests-regex "^(($programs)(_ranks)?|apps_.*)\$" ||
    say "some tests failed, see above"
fi

gcovr --root "$root" --filter "$root/src/" --object-directory "$build" --exclude-throw-branches \
  --exclude-unreachable-branches --gcov-ignore-parse-errors --json-summary "$build/coverage.json" "$build"
/usr/bin/python3 - "$build/coverage.json" <<'EOF'
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
