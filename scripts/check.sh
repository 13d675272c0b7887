#!/usr/bin/env bash
# Before each merge: formatting, static checks, build, tests (the include floors among them).
#   scripts/check.sh            everything
#   scripts/check.sh --format   put the formatting right instead of complaining
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
cmake --build build/release --target headers  # every header compiles alone
if command -v clang-tidy >/dev/null; then
  # Only what is compiled without torch: with it a file takes clang-tidy half a minute.
  mapfile -t light < <(git ls-files 'src/doppel/core/*.cpp' 'src/doppel/geometry/*.cpp' 'src/doppel/character/*.cpp')
  clang-tidy -p build/release --quiet "${light[@]}"
fi
