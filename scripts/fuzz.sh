#!/usr/bin/env bash
# Feeds the readers of case files and of options files with mutated input, under AddressSanitizer and
# UndefinedBehaviorSanitizer, both at once; needs clang-14 and libclang-rt-14-dev, and the result of scripts/build.sh.
# A crash, a hang or too much memory fails, and leaves the input in build/fuzz/.
#   scripts/fuzz.sh [SECONDS] [CORPUS]     SECONDS: for each (default 60); CORPUS: folder for the inputs that were found
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

seconds=${1:-60}
work=$build/fuzz
corpus=${2:-$work/corpus}
harnesses=(evaluate options)

if ! command -v clang++-14 >/dev/null || ! compgen -G "/usr/lib/llvm-14/lib/clang/*/lib/linux/libclang_rt.fuzzer-*" >/dev/null; then
  [[ ${CI:-} == true ]] && die "clang-14 and libclang-rt-14-dev are missing"
  say "clang-14 or libclang-rt-14-dev is missing: nothing is fuzzed"
  exit 77
fi
[[ -e $build/src/libpliant_base.a ]] || die "$build has no libraries; run scripts/build.sh first"
mkdir -p "$work"

# The readers are instrumented; all else comes from the ordinary build.
declare -A instrumented=(
  [evaluate]="src/scenarios/evaluate/evaluate.cpp src/scenarios/evaluate/case_input.cpp src/scenarios/evaluate/case_value.cpp src/base/text.cpp"
  [options]="src/base/options.cpp src/base/options_source.cpp src/base/nearest.cpp src/base/text.cpp"
)
declare -A seeds=([evaluate]="tests/data/evaluate/*.json" [options]="examples/*.yaml")
declare -A words=(
  [evaluate]="grep -oh '\"[A-Za-z0-9_-]\+\"' src/scenarios/evaluate/case_input.cpp src/scenarios/evaluate/evaluate.cpp"
  [options]="$build/apps/pliant -help_markdown | sed -n 's/^| \`-\([a-z_0-9]*\)\` .*/\"\1\"/p'"
)
as_system() { sed 's/-I/-isystem /g' <<<"$*"; }
flags=(-std=c++20 -O1 -g1 -w -DFMT_SHARED -fno-omit-frame-pointer
  -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -fno-sanitize=function,vptr,null,alignment,object-size
  -I"$root" -I"$build/include" -I"$build/version" -isystem /usr/include/eigen3
  $(as_system "$(pkg-config --cflags PETSc yaml-0.1)" "$(mpicxx --showme:compile)"))
libraries=(-Wl,--start-group "$build"/src/libpliant_*.a "$build"/src/ts/sundials/libpliant_*.a -Wl,--end-group)
# Instrumented objects come first and count; the libraries contain them, too.
sundials=$(sed -n 's/^find_package(SUNDIALS .* COMPONENTS \(.*\))$/\1/p' "$root/src/ts/sundials/TsSundialsDependencies.cmake")
packages=(-Wl,--allow-multiple-definition $(pkg-config --libs SLEPc PETSc yaml-0.1 fmt hdf5-openmpi zlib) $(mpicxx --showme:link) -lgomp
  $(printf -- '-lsundials_%s ' $sundials))

# As one process, without a network: Open MPI would load network libraries, which leak memory.
export OMPI_MCA_btl=self OMPI_MCA_ess_singleton_isolated=1 OMP_NUM_THREADS=1
# The library's operators new and delete (base/errors.cpp) conflict with the sanitizer's.
export ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1:alloc_dealloc_mismatch=0 UBSAN_OPTIONS=print_stacktrace=1

fuzz() {  # harness
  local folder=$corpus/$1
  mkdir -p "$folder" "$work/$1-files"
  cp ${seeds[$1]} "$folder"
  eval "${words[$1]}" | sort -u >"$work/$1.dict"
  # As one source, which compiles in half the time.
  printf '#include "%s"\n' ${instrumented[$1]} "tests/fuzz/$1.cpp" >"$work/$1.cpp"
  clang++-14 "${flags[@]}" "$work/$1.cpp" "${libraries[@]}" "${packages[@]}" -o "$work/$1"
  # Files that options name, for example logs, are written here.
  (cd "$work/$1-files" && TMPDIR=$work/$1-files "$work/$1" -max_total_time="$seconds" -timeout=25 -rss_limit_mb=2048 -max_len=4096 \
    -dict="$work/$1.dict" -artifact_prefix="$work/$1-" -print_final_stats=1 -close_fd_mask=1 "$folder") >"$work/$1.log" 2>&1
}

cd "$root"
declare -A process
for harness in "${harnesses[@]}"; do
  fuzz "$harness" &
  process[$harness]=$!
done
failed=()
for harness in "${harnesses[@]}"; do
  if wait "${process[$harness]}"; then
    say "$harness: $(sed -n 's/^stat::number_of_executed_units: *//p' "$work/$harness.log") inputs, nothing found"
  else
    tail -n 40 "$work/$harness.log" >&2
    failed+=("$harness")
  fi
done
((${#failed[@]} == 0)) || die "${failed[*]}: see above; the input is in $work/"
