#!/usr/bin/env bash
# Runs the tests as other processors would, with two threads, and beside a busy core, and prints a table. Numeric bounds
# must hold under each: they follow from the arithmetic, not from one processor.
#   scripts/test_settings.sh [CTEST OPTION ...]     e.g. -R '^(layers|render)$'; default: all tests but those of pages,
#                                                   which take minutes each and check no bounds
# SETTINGS names the rows: plain (kernels for any processor, OpenBLAS for Nehalem), haswell and zen (AVX2), skylakex
# (AVX-512), threads (two threads beside a busy core); default: all. A row that the processor cannot run is skipped, and
# the table says so. Needs scripts/test.sh once before.
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
  local name="$1" log="$folder/${1//[ ,:]/_}.log" started=$SECONDS failed
  "${@:2}" ctest --preset release --parallel "$(nproc)" "${selection[@]}" >"$log" 2>&1 || true
  failed="$(sed -n 's/^[\t ]*[0-9]* - \([^ ]*\) (.*/\1/p' "$log" | paste -sd' ')"
  echo "| $name | $(grep -o '[0-9]*% tests passed, [0-9]* tests failed out of [0-9]*' "$log" || echo "did not run") |" \
    "${failed:--} | $(((SECONDS - started + 59) / 60)) |"
}

# processor NAME FEATURE ISA CORE: a row with our kernels for ISA and those of OpenBLAS for CORE
processor() {
  if has "$2"; then
    row "$1" env DOPPEL_ISA="$3" OPENBLAS_CORETYPE="$4"
  else
    echo "| $1 | skipped: the processor lacks $2 | | |"
  fi
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
for setting in ${SETTINGS:-plain haswell zen skylakex threads}; do
  case "$setting" in
    plain) processor "no AVX: plain kernels, OpenBLAS Nehalem" sse4_2 plain Nehalem ;;
    haswell) processor "AVX2, OpenBLAS Haswell" avx2 avx2 Haswell ;;
    zen) processor "AVX2, OpenBLAS Zen" avx2 avx2 Zen ;;
    skylakex) processor "AVX-512, OpenBLAS SkylakeX" avx512f avx512 SkylakeX ;;
    threads) row "two threads, beside a busy core" beside_a_busy_core env OMP_NUM_THREADS=2 ;;
    *) echo "test_settings.sh: there is no setting '$setting'; see the head of the script" >&2 && exit 2 ;;
  esac
done
