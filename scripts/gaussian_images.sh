#!/usr/bin/env bash
# Makes docs/images/gaussians.jpg: the synthetic person filmed, its textured mesh and its Gaussians in a camera that
# nothing was trained on, in a movement that nothing was trained on: whole, and enlarged at hair, hem and hand.
#   scripts/gaussian_images.sh FOLDER     trains for about half an hour of one core; resumes after an interruption.
#                                         Needs ImageMagick and ffmpeg.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -eq 1 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
folder="$1" camera=6 frame=24 doppel="${DOPPEL:-build/release/tools/doppel}"
[ -f "$folder/capture/capture.yaml" ] || "$doppel" synth --preset small --out "$folder/capture"
"$doppel" prepare "$folder/capture" --mask-size 700 --out "$folder/prepared"
trained="[0,1,2,3,4,5]"
"$doppel" train configs/small/ddc.yaml --set capture="$folder/prepared" --stages egnet,lighting,deltanet \
  --set egnet.data.cameras="$trained" --set lighting.data.cameras="$trained" --set deltanet.data.cameras="$trained" \
  --set egnet.train.iterations=1500 --set deltanet.train.iterations=600 --out "$folder/ddc"
"$doppel" train configs/small/gaussians.yaml --set capture="$folder/prepared" --set ddc="$folder/ddc" \
  --set gaussians.data.cameras="$trained" --set gaussians.train.iterations=1500 --out "$folder/gaussians"
motion="$folder/capture/testing/skeletoolToGTPose/poseAngles.motion"
for renderer in mesh gaussians; do
  "$doppel" animate --run "$folder/gaussians" --renderer $renderer --motion "$motion" --format png \
    --capture "$folder/prepared" --camera $camera --background capture --out "$folder/$renderer"
  cp "$folder/$renderer/camera_${camera}_$(printf %06d $frame).png" "$folder/$renderer.png"
done
ffmpeg -v error -y -i "$folder/capture/testing/videos/stream00$camera.mp4" -vf "select=eq(n\,$frame)" -frames:v 1 \
  "$folder/film.png"
# Columns: film, mesh, Gaussians. Rows: the person, then the three parts, enlarged.
parts=("${PARTS:-232x290+72+70}" "${HAIR:-58x48+166+78}" "${HEM:-58x48+118+232}" "${HAND:-58x48+250+152}")
for image in film mesh gaussians; do
  for i in 0 1 2 3; do
    convert "$folder/$image.png" -crop "${parts[$i]}" +repage -resize 300x "$folder/$image-$i.png"
  done
  convert "$folder/$image"-{0,1,2,3}.png -append "$folder/$image-column.png"
done
convert "$folder"/{film,mesh,gaussians}-column.png +append -quality 85 docs/images/gaussians.jpg
