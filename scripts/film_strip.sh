#!/usr/bin/env bash
# Makes the film strip of the README from the results of scripts/quickstart.sh. Needs ImageMagick.
#   scripts/film_strip.sh DEMO OUT.jpg
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: scripts/film_strip.sh DEMO OUT.jpg" >&2; exit 2; }
demo="$1"; out="$2"
doppel="$(dirname "$0")/../build/release/tools/doppel"
frames="$(mktemp -d)"
trap 'rm -rf "$frames"' EXIT
"$doppel" animate --character "$demo/capture/character/actor.character" --model "$demo/run/actor.pt" --format png \
  --motion "$demo/capture/testing/skeletoolToGTPose/poseAngles.motion" --video-size 360 --out "$frames"
convert "$frames"/turntable_0000{00,08,16,24,32}.png -gravity center -crop 250x350+0+0 +repage +append -quality 85 "$out"
