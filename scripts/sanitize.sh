#!/usr/bin/env bash
# Builds the unit tests and the program with a checker, in a build folder of their own, and runs them.
# Fails on the first program with a finding.
#   scripts/sanitize.sh [address|thread|valgrind]
#     address   (default) AddressSanitizer and UndefinedBehaviorSanitizer, by GCC
#     thread    ThreadSanitizer, by clang and its OpenMP: GCC's OpenMP is not instrumented, its barriers are unseen
#     valgrind  memcheck
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

kind=${1:-address}
build=$root/build-$kind
names=(base geometry kernels model domain ts io analysis scenarios)
flow="-n 1600 -hopper_width 10 -pack_tolerance 0.01 -mu 31.6 -dt 7e-4 -t_end 0.2 -frame_interval 0.1 -threads 3"
flags="-fno-omit-frame-pointer"
compilers=()
runner=()
packages=()

# As one process, without a network: what Open MPI would load for that is not ours to check.
export OMPI_MCA_btl=self OMP_NUM_THREADS=3
case $kind in
  address)
    flags+=" -fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-var-tracking"
    # Open MPI leaks from plug-ins that are gone at the end, so that no suppression can name them.
    export ASAN_OPTIONS=detect_leaks=0:detect_stack_use_after_return=1 UBSAN_OPTIONS=print_stacktrace=1
    ;;
  thread)
    packages=(clang-14 libomp-14-dev libclang-rt-14-dev)
    llvm=/usr/lib/llvm-14
    compilers=(-D CMAKE_C_COMPILER=clang-14 -D CMAKE_CXX_COMPILER=clang++-14)
    flags+=" -fsanitize=thread"
    # Archer tells the sanitizer about OpenMP's barriers and locks.
    export OMP_TOOL_LIBRARIES=$llvm/lib/libarcher.so TSAN_OPTIONS=ignore_noninstrumented_modules=1
    # The others run on one thread; 6000 particles are several chunks.
    names=(model domain ts scenarios)
    flow="-n 6000 -hopper_wall_distance 187 ${flow#-n 1600 }"
    ;;
  valgrind)
    packages=(valgrind)
    runner=(valgrind --quiet --error-exitcode=9 --leak-check=no --num-callers=30)
    for file in /usr/share/openmpi/openmpi-valgrind.supp /usr/share/petsc/*/share/petsc/valgrind/petsc-val.supp; do
      [[ -f $file ]] && runner+=("--suppressions=$file")
    done
    names=(kernels model domain)  # 20 to 50 times slower than without
    flow="-model rough -n 20 -hopper_wall_distance 8 -hopper_width 4 -t_end 0.02 -frame_interval 0.01"
    ;;
  *) die "unknown argument $kind; usage: scripts/sanitize.sh [address|thread|valgrind]" ;;
esac
for package in "${packages[@]}"; do
  dpkg-query -W -f='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed ||
    die "$kind needs the Debian packages ${packages[*]} (apt-get install; $package is not there)"
done

"$root/scripts/setup.sh"
# Line numbers without variables: those cost GCC minutes per file here.
cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=RelWithDebInfo -D CMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -g1" \
  -D CMAKE_CXX_FLAGS="$flags" -D PLIANT_BUILD_EXAMPLES=OFF "${compilers[@]}"
cmake --build "$build" --parallel "$cores" --target pliant "${names[@]/#/test_}"

check() {
  say "== $kind: $(basename "$1") ${*:2}"
  "${runner[@]}" "$@" || die "$kind: $(basename "$1") failed or had findings, see above"
}
for name in "${names[@]}"; do
  check "$build/tests/test_$name"
done
rm -rf "$build/run"
read -ra options <<<"$flow"
check "$build/apps/pliant" hopper "${options[@]}" -output "$build/run"
say "$kind: no findings"
