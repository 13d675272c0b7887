#!/usr/bin/env bash
# Makes the images of created and fitted characters in the README, from a synthetic capture of a random person.
#   scripts/body_images.sh FOLDER     writes docs/images/created.jpg and docs/images/fitted.jpg. Needs ImageMagick.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -eq 1 ] || { echo "usage: scripts/body_images.sh FOLDER" >&2; exit 2; }
folder="$1" doppel="${DOPPEL:-build/release/tools/doppel}"
[ -f "$folder/capture/capture.yaml" ] || "$doppel" synth --preset small --body random:5 --frames 40 --out "$folder/capture"
"$doppel" character create "$folder/capture/character/actor.obj" --unit mm --up y --out "$folder/created"
"$doppel" character fit "$folder/capture" --out "$folder/fitted"
# One view of each of the six poses, side by side.
convert "$folder/created/poses.jpg" -crop 25%x100%+0+0 +repage -crop 1x6@ +repage +append -resize 1000x -quality 85 \
  docs/images/created.jpg
convert "$folder/fitted/fit.jpg" -crop 100%x50%+0+0 +repage -resize 900x -quality 85 docs/images/fitted.jpg
