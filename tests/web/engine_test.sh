#!/usr/bin/env bash
# Engine clips of the synthetic actor in a browser: examples/play_engine_clip.mjs moves the vertices as the program, with
# corrective shapes, and with helper joints in a compressed file.
#   engine_test.sh DOPPEL; exit code 77: skipped, see check_glb.sh
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
command -v chromium >/dev/null || { echo "engine_test.sh: chromium is not installed; skipped" >&2; exit 77; }
"$here/modules.sh"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
quiet() { "$@" >"$folder/log" 2>&1 || { cat "$folder/log" >&2; exit 1; }; }
quiet "$1" synth --preset tiny --frames 60 --test-frames 60 --out "$folder/capture"
quiet "$1" prepare "$folder/capture" --out "$folder/prepared"
quiet "$1" train "$here/../../configs/tiny/ddc.yaml" --set capture="$folder/prepared" --stages egnet \
  --set egnet.train.iterations=100 --out "$folder/run"
for take in training testing; do
  cp "$folder/capture/$take/skeletoolToGTPose/poseAngles.motion" "$folder/$take.motion"
done
quiet "$1" animate --run "$folder/run" --motion "$folder/training.motion" --unseen "$folder/testing.motion" \
  --format engine-glb --morphs 16 --fit-windows 600 --tolerance 0 --out "$folder/engine"
"$1" animate --run "$folder/run" --motion "$folder/training.motion" --format npy,engine-glb --helpers 16 \
  --fit-windows 600 --tolerance 0 --compress --json --out "$folder/helpers" >"$folder/report.json" 2>"$folder/log" ||
  { cat "$folder/log" >&2; exit 1; }
CHROMIUM="$(command -v chromium)"
export CHROMIUM
node "$here/check_engine.mjs" "$folder/engine/engine.glb"
node "$here/check_helpers.mjs" "$folder/helpers/engine.glb" "$folder/helpers/vertices.npy" "$folder/report.json"
