#!/usr/bin/env bash
# Films a trained actor with its dynamic texture as a camera of the capture sees it, the filmed person to its left, and
# logs the rate: OUT/camera_CAMERA.mp4 and OUT/rate.json (`speed`: frames a second, seconds of each part).
#   scripts/live_film.sh RUN PREPARED CAMERA VIDEO MOTION OUT     VIDEO: of that camera, the frames of MOTION
# SIZE=1024 (the default): pixels of the longer side.
set -euo pipefail
[ $# -eq 6 ] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
run="$1" prepared="$2" camera="$3" video="$4" motion="$5" out="$6"
doppel="${DOPPEL:-$(dirname "$0")/../build/release/tools/doppel}"
mkdir -p "$out"
"$doppel" animate --run "$run" --motion "$motion" --capture "$prepared" --camera "$camera" --background capture \
  --beside "$video" --format mp4 --video-size "${SIZE:-1024}" --out "$out" --json >"$out/rate.json"
cat "$out/rate.json"
