# Sourced by the other scripts: paths and shared functions.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build
cores=$(env -u OMP_NUM_THREADS -u OMP_THREAD_LIMIT nproc)  # builds use all cores, independent of the threads of runs
joined=(-D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=0)  # all sources of a folder, or of several, are compiled as one
werror=OFF  # warnings as errors: in CI
if [[ ${CI:-} == true ]]; then
  werror=ON
fi

say() { printf '%s\n' "$*"; }
die() {
  printf '%s: error: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}
