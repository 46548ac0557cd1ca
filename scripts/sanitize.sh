#!/usr/bin/env bash
# Builds the unit tests, or pliant itself, with a checker, in a separate build folder, and runs them. Fails if the checker
# reports an error.
#   scripts/sanitize.sh [address|thread|valgrind] [PROGRAM…]
#     address   (default) AddressSanitizer and UndefinedBehaviorSanitizer, by clang, which compiles these faster than GCC
#     thread    ThreadSanitizer, by clang and its OpenMP: GCC's OpenMP has barriers without instrumentation
#     valgrind  memcheck; it hides AVX-512, so the kernels for AVX2 run
#     PROGRAM   folders of tests/, like io; `pliant`, a short run of each scenario and model; `module`, tests of the Python
#               module (address: all; valgrind: its arrays); all tests of folders unless given
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

kind=${1:-address}
build=$root/build-$kind
names=("${@:2}")
flags="-fno-omit-frame-pointer"
optimised=-O1
clang=(-D CMAKE_C_COMPILER=clang-14 -D CMAKE_CXX_COMPILER=clang++-14)
compilers=()
linking=()
runner=()
findings=$build/findings  # of the sanitizers, in files: a test may silence its program
packages=(clang-14 libomp-14-dev libclang-rt-14-dev)

# As one process, without a network: Open MPI would load network libraries, which are not checked.
export OMPI_MCA_btl=self OMP_NUM_THREADS=3
case $kind in
  address)
    compilers=("${clang[@]}")
    optimised=-O0  # a third of the time to compile
    # Left out: faults that AddressSanitizer or the processor finds too; these checks are a good part of the compile time.
    flags+=" -fsanitize=address,undefined -fno-sanitize=null,alignment,object-size,vptr,function -fno-sanitize-recover=undefined"
    # Open MPI leaks memory in plug-ins that are unloaded at the end, so that no suppression can name them.
    export ASAN_OPTIONS="detect_leaks=0:detect_stack_use_after_return=1:log_path='$findings/address'"
    export UBSAN_OPTIONS="print_stacktrace=1:log_path='$findings/address'"
    ;;
  thread)
    compilers=("${clang[@]}")
    flags+=" -fsanitize=thread"
    # Archer informs the sanitizer about OpenMP's barriers and locks.
    export OMP_TOOL_LIBRARIES=/usr/lib/llvm-14/lib/libarcher.so
    export TSAN_OPTIONS="ignore_noninstrumented_modules=1:log_path='$findings/thread'"
    ;;
  valgrind)
    packages=(valgrind)
    flags+=" -Wno-maybe-uninitialized"  # with -O1 GCC warns about its headers, and about vectors that are set lane by
                                        # lane
    export HWLOC_COMPONENTS=-x86  # hwloc cannot inspect the processor there, and would print a warning
    runner=(valgrind --quiet --error-exitcode=9 --leak-check=no --num-callers=30)
    ;;
  *) die "unknown argument $kind; usage: scripts/sanitize.sh [address|thread|valgrind] [PROGRAM…]" ;;
esac
for package in "${packages[@]}"; do
  dpkg-query -W -f='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed ||
    die "$kind needs the Debian packages ${packages[*]} (apt-get install; $package is not there)"
done

if [[ $kind == address ]]; then
  # Programs link the shared library of the sanitizer, because the tests of the module preload it into Python, and the
  # programs that these tests start inherit LD_PRELOAD: with a second copy of the sanitizer inside they would not start.
  runtime=$(clang++-14 -print-file-name=libclang_rt.asan-x86_64.so)
  linking=(-D CMAKE_EXE_LINKER_FLAGS="-shared-libsan -Wl,-rpath,$(dirname "$runtime")")
fi
"$root/scripts/setup.sh"
# Line numbers without variables, which cost GCC minutes on some files.
cmake -S "$root" -B "$build" -G Ninja -D CMAKE_BUILD_TYPE=RelWithDebInfo -D CMAKE_CXX_FLAGS_RELWITHDEBINFO="$optimised -g1" \
  -D CMAKE_CXX_FLAGS="$flags" -D PLIANT_BUILD_EXAMPLES=OFF "${joined[@]}" "${compilers[@]}" "${linking[@]}"
((${#names[@]} > 0)) || read -ra names <"$build/tests/folders.txt"
targets=()
for name in "${names[@]}"; do
  case $name in
    pliant) targets+=(pliant) ;;
    module) targets+=(pliant pliant_python) ;;
    *) targets+=("test_$name") ;;
  esac
done
cmake --build "$build" --parallel "$cores" --target "${targets[@]}"

# A short run of each scenario and kind of particle, with reinsertion, restart and both kinds of integrator.
run_pliant() {
  local folder hopper=(hopper -n 12 -hopper_wall_distance 5 -hopper_width 3 -frame_interval 0.05 -sample_interval 0.05)
  folder=$(mktemp -d)
  printf '%s\n' '0 0' '2 0' '2 1' '0 1' >"$folder/rectangle"
  run() { "${runner[@]}" "$build/apps/pliant" "$@" >"$folder/log" 2>&1 || { cat "$folder/log" >&2; return 1; }; }
  run "${hopper[@]}" -t_end 1 -mu 1 -output "$folder/soft" &&
    run hopper -restart "$folder/soft" -t_end 1.2 &&
    run "${hopper[@]}" -t_end 0.3 -dim 3 -output "$folder/spheres" &&
    run "${hopper[@]}" -t_end 0.1 -model rough -n_vertices 8 -self_contact -output "$folder/rough" &&
    run "${hopper[@]}" -t_end 0.1 -model smooth -n_vertices 8 -mu 1 -output "$folder/smooth" &&
    run "${hopper[@]}" -t_end 0.1 -model disk -flow discharge -output "$folder/disks" &&
    run "${hopper[@]}" -t_end 0.1 -model disk -dim 3 -output "$folder/balls" &&
    run "${hopper[@]}" -t_end 0.1 -integrator ts -output "$folder/adaptive" &&
    run "${hopper[@]}" -t_end 0.1 -integrator ts -ts_type cn -output "$folder/implicit" &&
    run raft -rows 2 -columns 2 -n 3 -delta 0 -v_wall 1e-2 -output "$folder/raft" &&
    run clog -n 8 -t_end 50 -output "$folder/clog" &&
    run channel -channel_width 6 -channel_arm 11 -distribution bidisperse -area_fraction 0.5 -pushes 1 -stroke 0.05 \
      -output "$folder/channel" &&
    run channel -channel_width 6 -channel_arm 11 -distribution bidisperse -area_fraction 0.2 -pushes 1 -stroke 0.01 \
      -model rough -n_vertices 12 -shape_outline "$folder/rectangle" -output "$folder/rectangles" &&
    run pack -n 12 -pressure 1e-2 -output "$folder/packing" &&
    run shear -n 12 -path quench -fraction 0.95 -shear_rate 0.1 -strain 0.1 -output "$folder/shear" &&
    run vibrate -n 12 -box_width 4 -cycles 1 -output "$folder/vibrated" || return 1
  rm -r "$folder"
}

# Python itself is not instrumented, therefore AddressSanitizer is loaded before it. valgrind also sees numpy's reads of
# memory that the module has freed; it is slow, and checks the tests that hold arrays. Libraries of h5py and PETSc read
# undefined values and free memory of `new`, without harm. Left out: the tutorials, which take minutes, and a test that
# measures memory, of which the sanitizer keeps much.
run_module() {
  local python=(/usr/bin/python3 -B -m pytest -q -p no:cacheprovider) tests="not gallery and not leave_nothing_behind"
  export PYTHONPATH=$build/python PLIANT_PROGRAM=$build/apps/pliant
  case $kind in
    address) LD_PRELOAD=$runtime \
      "${python[@]}" "$root/tests/python" -k "$tests" ;;
    valgrind) PYTHONMALLOC=malloc "${runner[@]}" --undef-value-errors=no --show-mismatched-frees=no \
      --suppressions="$root/scripts/valgrind.supp" \
      "${python[@]}" "$root/tests/python/test_simulation.py" "$root/tests/python/test_overdamped.py" \
      -k "array or outlive or written or added_and_removed" ;;
    *) die "$kind has no check of the Python module" ;;
  esac
}

failed=()
for name in "${names[@]}"; do
  start=$SECONDS
  rm -rf "$findings"
  mkdir "$findings"
  passed=yes
  if [[ $name == pliant ]]; then
    run_pliant || passed=no
  elif [[ $name == module ]]; then
    run_module || passed=no
  else
    "${runner[@]}" "$build/tests/test_$name" || passed=no
  fi
  if compgen -G "$findings/*" >/dev/null; then
    cat "$findings"/*
    passed=no
  fi
  [[ $passed == yes ]] || failed+=("$name")
  say "$kind: $name: $((SECONDS - start)) s"
done
((${#failed[@]} == 0)) || die "$kind: failed or had findings, see above: ${failed[*]}"
say "$kind: no findings"
