#!/usr/bin/env bash
# Fuzzes the readers of files, each target for the same time: with libFuzzer, which needs Clang (Debian packages clang
# and libclang-rt-dev), or without Clang with the driver of the test `fuzz`, which does not look at the covered code.
#   scripts/fuzz.sh MINUTES [TARGET...]     all targets without a name; exits 1 on a finding
# Findings lie in build/fuzz/work/TARGET/finding-*. Each becomes an entry of tests/fuzz/regressions.cpp, built by code.
set -euo pipefail
cd "$(dirname "$0")/.."
[[ "${1:-}" =~ ^[0-9]+$ ]] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
minutes="$1"
shift
if ! command -v clang++ >/dev/null; then
  cmake --preset release >/dev/null
  cmake --build --preset release --parallel "$(nproc)" --target fuzz_driver
  mkdir -p build/fuzz/work
  cd build/fuzz/work
  exec ../../release/tests/fuzz/fuzz_driver --seconds $((60 * minutes)) "$@"
fi
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz --parallel "$(nproc)"
programs="build/fuzz/tests/fuzz"
[ $# -gt 0 ] || mapfile -t all < <("$programs/fuzz_driver" --list)
targets=("$@" "${all[@]:-}")
status=0
for target in "${targets[@]}"; do
  [ -n "$target" ] || continue
  work="build/fuzz/work/$target"
  mkdir -p "$work/corpus"
  "$programs/fuzz_driver" --write "$work" "$target"
  DOPPEL_FUZZ_TARGET="$target" "$programs/fuzz_libfuzzer" -max_total_time=$((60 * minutes)) -timeout=10 \
    -rss_limit_mb=1200 -malloc_limit_mb=400 -max_len=65536 -dict="$work/dictionary" -artifact_prefix="$work/finding-" \
    -print_final_stats=1 "$work/corpus" "$work/seeds" 2>"$work/log" || { status=1; tail -n 40 "$work/log" >&2; }
  echo "$target: $(grep -c . <(ls "$work/corpus")) inputs kept, $(ls "$work" | grep -c finding- || true) findings"
done
exit $status
