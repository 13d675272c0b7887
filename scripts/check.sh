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
# clang-tidy checks each unity batch as a whole: most of the time goes into LibTorch's headers. It cannot read GCC's
# precompiled headers. Clang 14 reports errors inside LibTorch's own headers, so only messages about our files count.
cmake --preset release -B build/tidy >/dev/null
cmake --build build/tidy --target src/train/tensorboard.pb.h
find build/tidy -name '*.gch' -delete
ours='/(src|tools|tests)/[a-z0-9_/]*\.(h|cpp)'
run-clang-tidy -p build/tidy -j "$(nproc)" -quiet -checks=-bugprone-suspicious-include -header-filter="$ours\$" \
  '^(?!.*/(headers|pch)/|.*_pch\.dir/).*\.(cpp|cxx)$' >build/tidy/report.txt 2>/dev/null || true
if sed 's/\x1b\[[0-9;]*m//g' build/tidy/report.txt | grep -E "^$PWD$ours:.*(warning|error):" | sort -u | grep .; then
  echo "check.sh: clang-tidy reports these; build/tidy/report.txt has the details" >&2
  exit 1
fi
