#!/usr/bin/env bash
# Builds the unit tests with a checker, in a build folder of its own, and runs them. Fails if a program has a finding.
#   scripts/sanitize.sh [address|thread|valgrind] [PROGRAM…]
#     address   (default) AddressSanitizer and UndefinedBehaviorSanitizer, by clang, which compiles these faster than GCC
#     thread    ThreadSanitizer, by clang and its OpenMP: GCC's OpenMP is not instrumented, its barriers are unseen
#     valgrind  memcheck; it hides AVX-512, so the kernels for AVX2 run
#     PROGRAM   folders of tests/, like io; all unless given
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

kind=${1:-address}
build=$root/build-$kind
names=("${@:2}")
flags="-fno-omit-frame-pointer"
clang=(-D CMAKE_C_COMPILER=clang-14 -D CMAKE_CXX_COMPILER=clang++-14)
compilers=()
runner=()
findings=$build/findings  # of the sanitizers, in files: a test may silence its program
packages=(clang-14 libomp-14-dev libclang-rt-14-dev)

# As one process, without a network: what Open MPI would load for that is not ours to check.
export OMPI_MCA_btl=self OMP_NUM_THREADS=3
case $kind in
  address)
    compilers=("${clang[@]}")
    # Left out: what AddressSanitizer or the processor finds too; these checks are a good part of the compile time.
    flags+=" -fsanitize=address,undefined -fno-sanitize=null,alignment,object-size,vptr,function -fno-sanitize-recover=undefined"
    # Open MPI leaks from plug-ins that are gone at the end, so that no suppression can name them.
    export ASAN_OPTIONS="detect_leaks=0:detect_stack_use_after_return=1:log_path='$findings/address'"
    export UBSAN_OPTIONS="print_stacktrace=1:log_path='$findings/address'"
    ;;
  thread)
    compilers=("${clang[@]}")
    flags+=" -fsanitize=thread"
    # Archer tells the sanitizer about OpenMP's barriers and locks.
    export OMP_TOOL_LIBRARIES=/usr/lib/llvm-14/lib/libarcher.so
    export TSAN_OPTIONS="ignore_noninstrumented_modules=1:log_path='$findings/thread'"
    ;;
  valgrind)
    packages=(valgrind)
    flags+=" -Wno-maybe-uninitialized"  # with -O1 GCC warns of its own headers, and of vectors that are set lane by lane
    export HWLOC_COMPONENTS=-x86  # hwloc's look at the processor cannot work there, and says so
    runner=(valgrind --quiet --error-exitcode=9 --leak-check=no --num-callers=30)
    ;;
  *) die "unknown argument $kind; usage: scripts/sanitize.sh [address|thread|valgrind] [PROGRAM…]" ;;
esac
for package in "${packages[@]}"; do
  dpkg-query -W -f='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed ||
    die "$kind needs the Debian packages ${packages[*]} (apt-get install; $package is not there)"
done

"$root/scripts/setup.sh"
# Line numbers without variables: those cost GCC minutes on some files.
cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=RelWithDebInfo -D CMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -g1" \
  -D CMAKE_CXX_FLAGS="$flags" -D PLIANT_BUILD_EXAMPLES=OFF "${joined[@]}" "${compilers[@]}"
((${#names[@]} > 0)) || read -ra names <"$build/tests/folders.txt"
cmake --build "$build" --parallel "$cores" --target "${names[@]/#/test_}"

failed=()
for name in "${names[@]}"; do
  start=$SECONDS
  rm -rf "$findings"
  mkdir "$findings"
  passed=yes
  "${runner[@]}" "$build/tests/test_$name" || passed=no
  if compgen -G "$findings/*" >/dev/null; then
    cat "$findings"/*
    passed=no
  fi
  [[ $passed == yes ]] || failed+=("test_$name")
  say "$kind: test_$name: $((SECONDS - start)) s"
done
((${#failed[@]} == 0)) || die "$kind: failed or had findings, see above: ${failed[*]}"
say "$kind: no findings"
