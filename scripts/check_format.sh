#!/usr/bin/env bash
# Fails if clang-format would change a C++ file; exits with 77 (skipped) without the version that Debian 12 has, as
# others format differently.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

wanted=14
clang_format=
for candidate in clang-format-$wanted clang-format; do
  if command -v $candidate >/dev/null && [[ $($candidate --version) == *"version $wanted."* ]]; then
    clang_format=$candidate
    break
  fi
done
if [[ -z $clang_format ]]; then
  say "skipped: clang-format $wanted is not installed"
  exit 77
fi
cd "$root"
find src apps examples tests benchmarks -name '*.h' -o -name '*.cpp' | sort | xargs "$clang_format" --dry-run --Werror
