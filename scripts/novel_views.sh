#!/usr/bin/env bash
# The four cells of Table 6.3: training or new motion, seen by training or new cameras.
#   scripts/novel_views.sh RUN TRAINING_CAMERAS OTHER_CAMERAS [EVERY]
#   scripts/novel_views.sh runs/anna 0,1,2,3,4,5 6,7
# RUN is a chain trained with the first list as `data.cameras` of every stage. Each EVERY-th frame counts (default 4).
set -euo pipefail
[ $# -ge 3 ] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
run=$1 trained=$2 other=$3 every=${4:-4}
doppel="${DOPPEL:-$(dirname "$0")/../build/release/tools/doppel}"
kept=$(mktemp)
trap 'rm -f "$kept"' EXIT
[ ! -f "$run/evaluation.json" ] || cp "$run/evaluation.json" "$kept"

# figures SPLIT CAMERAS: MSE and SSIM of the dynamic texture inside the mask, and its MSE as filmed
figures() {
  local result
  result=$("$doppel" evaluate --run "$run" --split "$1" --cameras "$2" --every "$every" --json | grep -o '"texnet":{.*' | sed 's/"cameras":.*//')
  for key in '"MSE"' '"SSIM"' '"filmed":{"MSE"'; do
    grep -o "$key:[0-9.e-]*" <<<"$result" | head -1 | sed 's/.*://' | xargs printf ' %.4g |'
  done
}

echo "| motion | cameras | MSE | SSIM | MSE as filmed |"
echo "|---|---|---:|---:|---:|"
echo "| training | training ($trained) |$(figures train "$trained")"
echo "| training | new ($other) |$(figures train "$other")"
echo "| new | training ($trained) |$(figures test "$trained")"
echo "| new | new ($other) |$(figures test "$other")"
# Restore the previous evaluation of the run.
[ ! -s "$kept" ] || cp "$kept" "$run/evaluation.json"
