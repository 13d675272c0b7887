#!/usr/bin/env bash
# Gaussians, and `doppel view` of the synthetic actor, in a browser.   view_test.sh DOPPEL; exit code 77: skipped
set -euo pipefail
command -v chromium >/dev/null || { echo "view_test.sh: chromium is not installed; skipped" >&2; exit 77; }
here="$(cd "$(dirname "$0")" && pwd)"
"$here/modules.sh"
CHROMIUM="$(command -v chromium)" node "$here/check_splats.mjs"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
"$1" synth --preset tiny --out "$folder/capture" >/dev/null 2>&1
CHROMIUM="$(command -v chromium)" node "$here/check_view.mjs" --cameras "$folder/cameras.png" \
  --other "$folder/capture/training/skeletoolToGTPose/poseAngles.motion" 24 "$1" "$folder/capture"
# Before the character is made.
grep -v -e '^character:' -e '^    motion:' "$folder/capture/capture.yaml" >"$folder/capture/filmed.yaml"
CHROMIUM="$(command -v chromium)" node "$here/check_view.mjs" --sequence "$folder/sequence.png" \
  "$1" "$folder/capture/filmed.yaml"
