#!/usr/bin/env bash
# An animation of the synthetic actor in a browser, plain and compressed.   glb_test.sh DOPPEL; exit code 77: skipped, see check_glb.sh
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
"$1" synth --preset tiny --out "$folder/capture" >/dev/null 2>&1
for form in plain compressed; do
  options=()
  [ "$form" = plain ] || options=(--compress)
  "$1" animate --character "$folder"/capture/character/*.character --format npy,glb,png --loop "${options[@]}" \
    --out "$folder/$form" --camera "$here/camera.json" --background '#00ff00' \
    --motion "$folder/capture/testing/skeletoolToGTPose/poseAngles.motion" >/dev/null 2>&1
  cp "$here/camera.json" "$folder/$form"
done
"$here/../../scripts/check_glb.sh" "$folder/plain/animation.glb" "$folder/compressed/animation.glb"
