#!/usr/bin/env bash
# Checks before each merge.
#   scripts/check.sh                     format shell text tests headers tidy
#   scripts/check.sh PIECE...            the pieces of these names:
#     format        the sources have the form that clang-format gives them
#     shell         static checks of the scripts by shellcheck
#     text          no white space at the ends of lines; YAML files can be read
#     tests         release build and all tests (including the include levels)
#     headers       every public and shared header compiles alone, ten minutes
#     headers-changed  the same for the headers that differ from DOPPEL_BASE, and those that include them
#     tidy          static checks by clang-tidy, half an hour
#     tidy-changed  the same for the files that differ from DOPPEL_BASE, at most five minutes
#     fuzz          the readers, compiled with sanitizers, on damaged files
#     asan          tests with the sanitizers of addresses and undefined behaviour
#     leak          the same build: memory that is never freed
#     tsan          tests with the sanitizer of threads
#   scripts/check.sh --format            only reformat the sources
# DOPPEL_BASE is a revision; the default is where this branch left origin/main, or HEAD~1 without origin/main.
# SANITIZED_TESTS names the tests of the last three; a build for all takes half an hour, so only theirs are built.
# scripts/install_dependencies.sh checks installs the tools. The sources have the form of clang-format 14, as in Debian 12.
set -euo pipefail
cd "$(dirname "$0")/.."
mapfile -t sources < <(git ls-files '*.h' '*.cpp')
if [ "${1:-}" = "--format" ]; then
  clang-format -i "${sources[@]}"
  exit 0
fi
export CMAKE_BUILD_PARALLEL_LEVEL="${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}"

need() {
  command -v "$1" >/dev/null || { echo "check.sh: $1 is missing; run scripts/install_dependencies.sh checks" >&2; exit 1; }
}

check_format() {
  need clang-format
  printf '%s\0' "${sources[@]}" | xargs -0 -n 50 -P "$(nproc)" clang-format --dry-run --Werror
}

check_shell() {
  need shellcheck
  git ls-files -z '*.sh' '*.sbatch' .ci/run | xargs -0 shellcheck --external-sources --severity=warning
}

check_text() {
  if git grep -nIE '[[:space:]]+$' -- ':!web/dist' ':!LICENSE'; then
    echo "check.sh: these lines end in white space; remove it" >&2
    exit 1
  fi
  git ls-files -z '*.yaml' '*.yml' '*.cff' .clang-format .clang-tidy | xargs -0 python3 -c '
import sys, yaml
for name in sys.argv[1:]:
    with open(name) as file:
        list(yaml.parse(file))
'
}

check_tests() { scripts/test.sh; }

check_headers() {
  cmake --preset release >/dev/null
  cmake --build build/release --target headers
}

# base_revision: the revision that headers-changed and tidy-changed compare with
base_revision() {
  local base="${DOPPEL_BASE:-}"
  [ -n "$base" ] || base="$(git merge-base origin/main HEAD 2>/dev/null || echo HEAD~1)"
  git rev-parse --quiet --verify "$base^{commit}" ||
    { echo "check.sh: there is no revision '$base' to compare with; name one by DOPPEL_BASE" >&2; return 1; }
}

# units_of: for the headers on standard input, the Ninja targets that compile each of them alone
units_of() { grep -rlFf <(sed 's|^src/\(.*\)|#include "doppel/\1"|') build/release/headers | sed "s|.*|$PWD/&^|"; }

check_headers-changed() {
  local base units
  base="$(base_revision)"
  cmake --preset release >/dev/null
  mapfile -t units < <({
    git diff --name-only --diff-filter=d "$base" -- 'src/*.h' | tee /dev/fd/3 |
      git grep -lFf <(sed 's|^src/\(.*\)|#include "doppel/\1"|') -- 'src/*.h'
  } 3>&1 | units_of)
  echo "${#units[@]} headers"
  [ ${#units[@]} -eq 0 ] || cmake --build build/release --target "${units[@]}"
}

# Clang 14 reports errors inside LibTorch's own headers, so only messages about our files count. The compiler finds our
# headers through the link build/tidy/include/doppel.
ours='/(src|tools|tests|build/tidy/include/doppel)/[a-z0-9_/]*\.(h|cpp)'

# Clang has no omp.h without its own OpenMP library; GCC's serves, behind all headers of Clang.
omp_headers="-idirafter$(dirname "$(gcc -print-file-name=include/omp.h)")"

# configure_tidy BATCH: compile commands in build/tidy, and the headers that the build generates. Nothing is compiled: a
# target of a generated header would build all modules below its own first. So there are no precompiled headers of GCC,
# which clang-tidy cannot read.
configure_tidy() {
  need clang-tidy
  cmake --preset release -B build/tidy -DDOPPEL_UNITY_BATCH="$1" >/dev/null
  local header
  for header in $(ninja -C build/tidy -t targets rule CUSTOM_COMMAND | grep '^src/.*\.h$'); do
    sh -c "$(ninja -C build/tidy -t commands -s "$header")" >/dev/null
  done
}

# report_tidy FILE...: fails if the reports say something about our files
report_tidy() {
  if sed 's/\x1b\[[0-9;]*m//g' "$@" | grep -E "^$PWD$ours:.*(warning|error):" | sort -u | grep .; then
    echo "check.sh: clang-tidy reports these; the details: $*" >&2
    exit 1
  fi
}

# Each unity batch is checked as a whole: most of the time goes into LibTorch's headers.
check_tidy() {
  configure_tidy 10
  run-clang-tidy -p build/tidy -j "$(nproc)" -quiet -extra-arg="$omp_headers" \
    -checks=-bugprone-suspicious-include -header-filter="$ours\$" \
    '^(?!.*/(headers|pch)/|.*_pch\.dir/).*\.(cpp|cxx)$' >build/tidy/report.txt 2>/dev/null || true
  report_tidy build/tidy/report.txt
}

# Sources that differ from revision $1, those with the most new lines first. A header stands for the source of the same
# name beside it. Moved files are compared with what they were.
changed_sources() {
  git diff --numstat -z -M -l0 --diff-filter=d "$1" -- '*.cpp' '*.h' | tr '\0' '\n' |
    awk -F '\t' '{ lines = $1; name = $3; if (name == "") { getline; getline; name = $0 }; print lines "\t" name }' |
    sort -rn | cut -f2 | sed 's/\.h$/.cpp/' | awk '!seen[$0]++' | while read -r source; do
      ! grep -qF "\"$PWD/$source\"" build/tidy/compile_commands.json || echo "$source"
    done
}

check_tidy-changed() {
  local base changed source checked=0
  base="$(base_revision)"
  configure_tidy 1
  mapfile -t changed < <(changed_sources "$base")
  rm -rf build/tidy/reports && mkdir build/tidy/reports
  SECONDS=0
  for source in "${changed[@]}"; do
    [ $SECONDS -lt 300 ] || break
    [ "$(jobs -rp | wc -l)" -lt "$(nproc)" ] || wait -n || true
    clang-tidy -p build/tidy --quiet --extra-arg="$omp_headers" --header-filter="$ours\$" "$source" \
      >"build/tidy/reports/${source//\//-}.txt" 2>/dev/null &
    checked=$((checked + 1))
  done
  wait
  echo "$checked of the ${#changed[@]} sources that differ from $(git rev-parse --short "$base") were checked"
  [ $checked -eq 0 ] || report_tidy build/tidy/reports/*
}

check_fuzz() {
  cmake --preset fuzz-check >/dev/null
  cmake --build --preset fuzz-check
  ctest --preset fuzz-check -R '^fuzz$'
}

# run_sanitized CONFIGURE_PRESET TEST_PRESET TEST...
run_sanitized() {
  local build=$1 preset=$2
  shift 2
  local tests
  read -ra tests <<<"${SANITIZED_TESTS:-$*}"
  cmake --preset "$build" >/dev/null
  cmake --build --preset "$build" --target "${tests[@]/%/_test}"
  OMP_NUM_THREADS=1 ctest --preset "$preset" -R "^($(IFS='|' && echo "${tests[*]}"))\$"
}
check_asan() { run_sanitized asan asan core geometry character calibration detect data actor train track; }
check_leak() { run_sanitized asan leak core geometry character calibration detect data; }
check_tsan() { run_sanitized tsan tsan core data train track synth; }

pieces=("$@")
[ $# -gt 0 ] || pieces=(format shell text tests headers tidy)
for piece in "${pieces[@]}"; do
  declare -F "check_$piece" >/dev/null || { echo "check.sh: unknown piece '$piece'; see the head of the script" >&2; exit 2; }
  echo "== $piece"
  "check_$piece"
done
