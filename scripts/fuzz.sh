#!/usr/bin/env bash
# Fuzzes the readers of files with libFuzzer, which needs Clang (Debian packages clang, libclang-rt-dev and libomp-dev,
# of one version). Without Clang, the driver of the test `fuzz` takes its place, which does not look at the covered code.
#   scripts/fuzz.sh MINUTES [TARGET...]     each target for that time; all targets without a name. Exits 1 on a finding
#   scripts/fuzz.sh --share MINUTES         that time on all cores, for the targets that are furthest from their goal: 3
#                                           CPU minutes, 10 for the ten with the most edges. A target with a finding
#                                           waits until it was run by its name without one
#   scripts/fuzz.sh --table                 figures of all runs so far, a row for each target
#   scripts/fuzz.sh --coverage TARGET...    edges of the sources that the kept inputs of a target run (package llvm)
# Findings lie in build/fuzz/work/TARGET/finding-*. Each becomes an entry of tests/fuzz/regressions.cpp, built by code.
# DOPPEL_FUZZ_WORK is another folder for findings, figures and the inputs that covered something new: a later run, also
# on another machine, continues from there. FUZZ_JOBS is another number of cores for --share.
set -euo pipefail
cd "$(dirname "$0")/.."
programs="build/fuzz/tests/fuzz"
works="${DOPPEL_FUZZ_WORK:-build/fuzz/work}"
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

# run_target TARGET SECONDS: fails on a finding
run_target() {
  local target="$1" work="$works/$1" cpu
  mkdir -p "$work/corpus"
  "$programs/fuzz_driver" --write "$work" "$target"
  rm -f "$work/failed"
  TIMEFORMAT="%U %S"
  cpu="$( { time DOPPEL_FUZZ_TARGET="$target" "$programs/fuzz_libfuzzer" -max_total_time="$2" -timeout=60 \
    -rss_limit_mb=1200 -malloc_limit_mb=400 -max_len=65536 -dict="$work/dictionary" -artifact_prefix="$work/finding-" \
    -print_final_stats=1 "$work/corpus" "$work/seeds" >"$work/log" 2>&1 || touch "$work/failed"; } 2>&1 |
    awk 'END { print $1 + $2 }')"
  add_figures "$target" "$cpu"
  awk -v target="$target" '$1 == target { line = $0 }
    END { $0 = line; printf "%s: %.1f CPU minutes, %d executions, %d edges", $1, $2 / 60, $3, $4 }' "$works/figures"
  [ -e "$work/failed" ] || { echo; return 0; }
  echo ", a finding"
  tail -n 40 "$work/log" >&2
  return 1
}

# furthest COUNT: the targets without a finding that have the smallest part of their goal
furthest() {
  local largest
  largest="$(sort -k4,4nr "$works/figures" | awk '!seen[$1]++ { print $1 }' | head -n 10 | paste -sd ' ')"
  "$programs/fuzz_driver" --list | awk -v largest="$largest" -v figures="$works/figures" '
    BEGIN { while ((getline line < figures) > 0) { split(line, f, " "); cpu[f[1]] += f[2] }
            split(largest, names, " "); for (i in names) goal[names[i]] = 600 }
    { print cpu[$1] / ($1 in goal ? goal[$1] : 180), $1 }' | sort -g | while read -r _ target; do
      [ -e "$works/$target/failed" ] || echo "$target"
    done | head -n "$1"
}

share_minutes() {
  local end=$((SECONDS + 60 * $1)) status=0 targets target slice
  while slice=$((end - SECONDS)) && [ $slice -gt 0 ]; do
    mapfile -t targets < <(furthest "${FUZZ_JOBS:-$(nproc)}")
    [ ${#targets[@]} -gt 0 ] || break
    for target in "${targets[@]}"; do run_target "$target" $((slice < 60 ? slice : 60)) & done
    for target in "${targets[@]}"; do wait -n || status=1; done
  done
  return $status
}

usage() { sed -n '2,12s/^# //p' "$0" >&2; exit 2; }

case "${1:-}" in
  --table) print_table; exit ;;
  --coverage) shift; print_coverage "$@"; exit ;;
  --share) [[ "${2:-}" =~ ^[0-9]+$ ]] || usage ;;
  *) [[ "${1:-}" =~ ^[0-9]+$ ]] || usage ;;
esac
if ! command -v clang++ >/dev/null; then
  [ "$1" != --share ] || { echo "fuzz.sh: --share needs Clang" >&2; exit 1; }
  cmake --preset release >/dev/null
  cmake --build --preset release --parallel "$(nproc)" --target fuzz_driver
  mkdir -p "$works"
  programs="$PWD/build/release/tests/fuzz"
  cd "$works"
  exec "$programs/fuzz_driver" --seconds $((60 * $1)) "${@:2}"
fi
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz --parallel "$(nproc)"
mkdir -p "$works"
touch "$works/figures"
if [ "$1" = --share ]; then
  share_minutes "$2"
  exit
fi
targets=("${@:2}")
[ ${#targets[@]} -gt 0 ] || mapfile -t targets < <("$programs/fuzz_driver" --list)
status=0
for target in "${targets[@]}"; do
  run_target "$target" $((60 * $1)) || status=1
done
exit $status
