#!/usr/bin/env bash
# Checks before each merge: formatting, static checks, build, tests (including the include levels).
#   scripts/check.sh            everything
#   scripts/check.sh --format   only reformat the sources
set -euo pipefail
cd "$(dirname "$0")/.."
mapfile -t sources < <(git ls-files '*.h' '*.cpp')
if [ "${1:-}" = "--format" ]; then
  clang-format -i "${sources[@]}"
  exit 0
fi
command -v clang-format >/dev/null || { echo "check.sh needs clang-format and clang-tidy (Debian packages of that name)" >&2; exit 1; }
clang-format --dry-run --Werror "${sources[@]}"
scripts/test.sh
cmake --build build/release --target headers  # compiles every header alone
if command -v clang-tidy >/dev/null; then
  # clang-tidy needs a compile command for each source. A unity build has none.
  cmake --preset release -B build/tidy -DDOPPEL_UNITY_BATCH=1 >/dev/null
  # Only files without torch: with torch, clang-tidy takes half a minute per file.
  mapfile -t light < <(git ls-files 'src/core/*.cpp' 'src/geometry/*.cpp' 'src/character/*.cpp')
  clang-tidy -p build/tidy --quiet "${light[@]}"
fi
