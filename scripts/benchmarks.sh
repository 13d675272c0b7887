#!/usr/bin/env bash
# Runs ten benchmarks of docs/benchmarks.md with the settings that `doppel` gives its threads and its memory, on an
# idle machine or beside busy processes.
#   scripts/benchmarks.sh FOLDER [BUSY]     BUSY processes keep a core busy (default: 0); writes FOLDER/NAME.txt, FOLDER
# relative to the repository
# Build the preset `bench` first. THREADS=2 (the default). Leave the machine alone: about five minutes.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
folder="$1" busy="${2:-0}" threads="${THREADS:-2}" programs=build/release/benchmarks
mkdir -p "$folder"
export GOMP_SPINCOUNT=3000 OPENBLAS_THREAD_TIMEOUT=12
export MALLOC_MMAP_MAX_=0 MALLOC_TRIM_THRESHOLD_=4294967296 MALLOC_TOP_PAD_=16777216
if grep -q avx512f /proc/cpuinfo; then export OPENBLAS_CORETYPE=SkylakeX; fi

pids=()
trap 'kill "${pids[@]}" 2>/dev/null || true' EXIT
for ((i = 0; i < busy; ++i)); do
  (while :; do :; done) &
  pids+=($!)
done

run() { # PROGRAM [argument ...]
  local name="${1##*/}"
  echo "$name, $busy busy processes"
  if ! "$programs/$1" "${@:2}" >"$folder/$name.txt" 2>&1; then
    echo "$1 failed; see $folder/$name.txt" >&2
    exit 1
  fi
}
for program in render/raster_bench render/silhouette_bench layers/skinning_bench layers/embedded_deformation_bench \
  layers/graph_convolution_bench nets/egnet_bench nets/deltanet_bench nets/radiance_bench actor/actor_bench; do
  run "$program" "$threads"
done
run geometry/closest_point_bench
