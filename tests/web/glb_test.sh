#!/usr/bin/env bash
# An animation of the synthetic actor in a browser, plain and compressed.
#   glb_test.sh DOPPEL; exit code 77: skipped, see check_glb.sh
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
"$1" synth --preset tiny --out "$folder/capture" >/dev/null 2>&1
# film DOPPEL NAME OPTION ...: the animation, in the folder NAME
film() {
  "$1" animate --character "$folder"/capture/character/*.character --loop --out "$folder/$2" "${@:3}" \
    --camera "$here/camera.json" --background '#00ff00' \
    --motion "$folder/capture/testing/skeletoolToGTPose/poseAngles.motion" >/dev/null 2>&1
  cp "$here/camera.json" "$folder/$2"
}
film "$1" plain --format npy,glb,fbx,pc2,png
film "$1" compressed --format npy,glb,png --compress
"$here/../../scripts/check_glb.sh" "$folder/plain/animation.glb" "$folder/plain/animation.fbx" \
  "$folder/compressed/animation.glb"
