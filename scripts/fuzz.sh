#!/usr/bin/env bash
# Fuzzes the readers of files, each target for the same time: with libFuzzer, which needs Clang (Debian packages clang,
# libclang-rt-dev and libomp-dev, of one version), or without Clang with the driver of the test `fuzz`, which does not
# look at the covered code.
#   scripts/fuzz.sh MINUTES [TARGET...]     all targets without a name; exits 1 on a finding
#   scripts/fuzz.sh --table                 figures of all runs so far, a row for each target
#   scripts/fuzz.sh --coverage TARGET...    edges of the sources that the kept inputs of a target run (package llvm)
# Findings lie in build/fuzz/work/TARGET/finding-*. Each becomes an entry of tests/fuzz/regressions.cpp, built by code.
set -euo pipefail
cd "$(dirname "$0")/.."
programs="build/fuzz/tests/fuzz"
works="build/fuzz/work"
# Debian's newest Clang before the default one, with its symbolizer.
newest="$(find /usr/lib -path '/usr/lib/llvm-*/bin/clang++' | sort -V | tail -n 1)"
[ -z "$newest" ] || export PATH="${newest%/*}:$PATH"

# Adds a line to $works/figures: target, seconds of CPU, executions, edges covered.
add_figures() {
  awk -v target="$1" -v cpu="$2" '
    / cov: / { for (i = 1; i < NF; ++i) if ($i == "cov:") edges = $(i + 1) }
    /^stat::number_of_executed_units:/ { runs = $2 }
    END { print target, cpu, runs + 0, edges + 0 }' "$works/$1/log" >>"$works/figures"
}

print_table() {
  echo "| target | CPU minutes | executions | edges | inputs kept |"
  echo "|---|---|---|---|---|"
  awk '{ cpu[$1] += $2; runs[$1] += $3; if ($4 > edges[$1]) edges[$1] = $4 }
       END { for (t in cpu) printf "%s %.1f %d %d\n", t, cpu[t] / 60, runs[t], edges[t] }' "$works/figures" | sort |
    while read -r target cpu runs edges; do
      echo "| \`$target\` | $cpu | $runs | $edges | $(find "$works/$target/corpus" -type f | wc -l) |"
    done
}

# For each source of which an input runs a function: edges that are run, and edges in all.
print_coverage() {
  for target in "$@"; do
    echo "$target"
    DOPPEL_FUZZ_TARGET="$target" "$programs/fuzz_libfuzzer" -runs=0 -print_coverage=1 "$works/$target/corpus" \
      "$works/$target/seeds" 2>&1 | awk '
        /COVERED_FUNC:/ && match($0, /\/src\/[a-z_]+\/[a-z_0-9\/]+\.cpp/) {
          file = substr($0, RSTART + 1, RLENGTH - 1)
          match($0, /edges: [0-9]+\/[0-9]+/)
          split(substr($0, RSTART + 7, RLENGTH - 7), edges, "/")
          run[file] += edges[1]; all[file] += edges[2] }
        END { for (file in run) if (run[file] > 0) printf "  %s %d of %d\n", file, run[file], all[file] }' | sort
  done
}

case "${1:-}" in
  --table) print_table; exit ;;
  --coverage) shift; print_coverage "$@"; exit ;;
esac
[[ "${1:-}" =~ ^[0-9]+$ ]] || { sed -n '2,9s/^# //p' "$0" >&2; exit 2; }
minutes="$1"
shift
if ! command -v clang++ >/dev/null; then
  cmake --preset release >/dev/null
  cmake --build --preset release --parallel "$(nproc)" --target fuzz_driver
  mkdir -p "$works"
  cd "$works"
  exec ../../release/tests/fuzz/fuzz_driver --seconds $((60 * minutes)) "$@"
fi
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz --parallel "$(nproc)"
[ $# -gt 0 ] || mapfile -t all < <("$programs/fuzz_driver" --list)
targets=("$@" "${all[@]:-}")
status=0
for target in "${targets[@]}"; do
  [ -n "$target" ] || continue
  work="$works/$target"
  mkdir -p "$work/corpus"
  "$programs/fuzz_driver" --write "$work" "$target"
  rm -f "$work/failed"
  TIMEFORMAT="%U %S"
  cpu="$( { time DOPPEL_FUZZ_TARGET="$target" "$programs/fuzz_libfuzzer" -max_total_time=$((60 * minutes)) -timeout=60 \
    -rss_limit_mb=1200 -malloc_limit_mb=400 -max_len=65536 -dict="$work/dictionary" -artifact_prefix="$work/finding-" \
    -print_final_stats=1 "$work/corpus" "$work/seeds" >"$work/log" 2>&1 || touch "$work/failed"; } 2>&1 |
    awk 'END { print $1 + $2 }')"
  add_figures "$target" "$cpu"
  [ ! -e "$work/failed" ] || { status=1; tail -n 40 "$work/log" >&2; }
  tail -n 1 "$works/figures" |
    awk '{ printf "%s: %.1f CPU minutes, %d executions, %d edges", $1, $2 / 60, $3, $4 }'
  [ -e "$work/failed" ] && echo ", a finding" || echo
done
exit $status
