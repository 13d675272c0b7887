#!/usr/bin/env bash
# Runs the tests under other instruction sets, other kernels of OpenBLAS, two threads, and beside a busy core, and prints
# a table. Numeric bounds must hold under each: they follow from the arithmetic, not from one processor.
#   scripts/test_settings.sh [CTEST OPTION ...]     e.g. -R '^(layers|render)$'; default: all tests but those of pages,
#                                                   which take minutes each and check no bounds
# Settings that the processor does not have are skipped, and the table says so. Needs scripts/test.sh once before.
set -euo pipefail
cd "$(dirname "$0")/.."
selection=("$@")
[ ${#selection[@]} -gt 0 ] || selection=(-E '^(docs_.*|install|.*_web|web_page|words|levels)$')
export OMP_NUM_THREADS=1 MALLOC_MMAP_MAX_=0 MALLOC_TRIM_THRESHOLD_=4294967296 MALLOC_TOP_PAD_=16777216
folder="build/test_settings"
mkdir -p "$folder"

has() { grep -qw "$1" /proc/cpuinfo; }

# row NAME COMMAND ...: the tests, run by COMMAND
row() {
  local name="$1" log="$folder/${1//[ ,]/_}.log" started=$SECONDS failed
  "${@:2}" ctest --preset release --parallel "$(nproc)" "${selection[@]}" >"$log" 2>&1 || true
  failed="$(sed -n 's/^[\t ]*[0-9]* - \([^ ]*\) (.*/\1/p' "$log" | paste -sd' ')"
  echo "| $name | $(grep -o '[0-9]*% tests passed, [0-9]* tests failed out of [0-9]*' "$log" || echo "did not run") |" \
    "${failed:--} | $(((SECONDS - started + 59) / 60)) |"
}
skipped() { echo "| $1 | skipped: the processor lacks $2 | | |"; }

# row_of FEATURE NAME VARIABLE=VALUE ...: a row where the processor has FEATURE
row_of() {
  if has "$1"; then row "$2" env "${@:3}"; else skipped "$2" "$1"; fi
}

beside_a_busy_core() {
  (while :; do :; done) &
  local busy=$! status=0
  "$@" || status=$?
  kill "$busy"
  return "$status"
}

echo "| setting | tests | failed | minutes |"
echo "|---|---|---|---:|"
row "plain kernels" env DOPPEL_ISA=plain
row_of avx2 "AVX2 kernels" DOPPEL_ISA=avx2
row_of avx512f "AVX-512 kernels" DOPPEL_ISA=avx512
row_of sse4_2 "OpenBLAS Nehalem" OPENBLAS_CORETYPE=Nehalem
row_of avx2 "OpenBLAS Haswell" OPENBLAS_CORETYPE=Haswell
row_of avx2 "OpenBLAS Zen" OPENBLAS_CORETYPE=Zen
row_of avx512f "OpenBLAS SkylakeX" OPENBLAS_CORETYPE=SkylakeX
row "two threads" env OMP_NUM_THREADS=2
row "beside a busy core" beside_a_busy_core
