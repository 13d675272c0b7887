#!/usr/bin/env bash
# Checks before each merge.
#   scripts/check.sh                     format tests headers tidy
#   scripts/check.sh PIECE...            the pieces of these names:
#     format    the sources have the form that clang-format gives them
#     tests     release build and all tests (including the include levels)
#     headers   every header compiles alone
#     tidy      static checks by clang-tidy
#     asan      tests with the sanitizers of addresses and undefined behaviour
#     leak      the same build: memory that is never freed
#     tsan      tests with the sanitizer of threads
#   scripts/check.sh --format            only reformat the sources
# SANITIZED_TESTS names the tests of the last three; a build for all takes half an hour, so only theirs are built.
set -euo pipefail
cd "$(dirname "$0")/.."
mapfile -t sources < <(git ls-files '*.h' '*.cpp')
if [ "${1:-}" = "--format" ]; then
  clang-format -i "${sources[@]}"
  exit 0
fi
export CMAKE_BUILD_PARALLEL_LEVEL="${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}"

check_format() {
  command -v clang-format >/dev/null ||
    { echo "check.sh needs clang-format and clang-tidy (Debian packages of that name)" >&2; exit 1; }
  clang-format --dry-run --Werror "${sources[@]}"
}

check_tests() { scripts/test.sh; }

check_headers() {
  cmake --preset release >/dev/null
  cmake --build build/release --target headers
}

# clang-tidy checks each unity batch as a whole: most of the time goes into LibTorch's headers. It cannot read GCC's
# precompiled headers. Clang 14 reports errors inside LibTorch's own headers, so only messages about our files count.
check_tidy() {
  cmake --preset release -B build/tidy >/dev/null
  cmake --build build/tidy --target src/train/tensorboard.pb.h
  find build/tidy -name '*.gch' -delete
  local ours='/(src|tools|tests)/[a-z0-9_/]*\.(h|cpp)'
  run-clang-tidy -p build/tidy -j "$(nproc)" -quiet -checks=-bugprone-suspicious-include -header-filter="$ours\$" \
    '^(?!.*/(headers|pch)/|.*_pch\.dir/).*\.(cpp|cxx)$' >build/tidy/report.txt 2>/dev/null || true
  if sed 's/\x1b\[[0-9;]*m//g' build/tidy/report.txt | grep -E "^$PWD$ours:.*(warning|error):" | sort -u | grep .; then
    echo "check.sh: clang-tidy reports these; build/tidy/report.txt has the details" >&2
    exit 1
  fi
}

# run_sanitized CONFIGURE_PRESET TEST_PRESET TEST...
run_sanitized() {
  local build=$1 preset=$2
  shift 2
  local tests=(${SANITIZED_TESTS:-$*})
  cmake --preset "$build" >/dev/null
  cmake --build --preset "$build" --target "${tests[@]/%/_test}"
  OMP_NUM_THREADS=1 ctest --preset "$preset" -R "^($(IFS='|' && echo "${tests[*]}"))\$"
}
check_asan() { run_sanitized asan asan core geometry character calibration keypoints capture data actor train track; }
check_leak() { run_sanitized asan leak core geometry character calibration keypoints capture data; }
check_tsan() { run_sanitized tsan tsan core capture data train track; }

pieces=("$@")
[ $# -gt 0 ] || pieces=(format tests headers tidy)
for piece in "${pieces[@]}"; do
  declare -F "check_$piece" >/dev/null || { echo "check.sh: unknown piece '$piece'; see the head of the script" >&2; exit 2; }
  echo "== $piece"
  "check_$piece"
done
