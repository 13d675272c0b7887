#!/usr/bin/env bash
# The figures of docs/results/filmed.md: an actor of a filmed person, judged in a camera that nothing was made from. For
# each camera in turn, the body is fitted, tracked, refined and trained without this camera and without the last quarter
# of the frames; the networks are evaluated on these frames, in this camera and in the others.
#   scripts/filmed.sh RECORDING CAMERAS [FOLDER]     default: the folder filmed; resumes after an interruption
# RECORDING holds videos and a calibration; CAMERAS are the names of its cameras, separated by commas. LEFT_OUT="5 13"
# leaves out these cameras alone. SHARE=1 (the default) of the recipe's steps are made. SEEDS=1 (the default here).
# With LEFT_OUT_OF=networks, body and poses are made from all cameras, and the networks alone are trained without one.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 2 ] || { sed -n '2,9s/^# //p' "$0" >&2; exit 2; }
recording="$1" cameras="$2" folder="${3:-filmed}"
export SEEDS="${SEEDS:-1}"
source scripts/figures.sh
unset OMP_NUM_THREADS
mkdir -p "$folder"
read -ra all <<<"${cameras//,/ }"
read -ra left_out <<<"${LEFT_OUT:-${all[*]}}"
left_out_of="${LEFT_OUT_OF:-everything}"
[[ $left_out_of =~ ^(everything|networks)$ ]] ||
  { echo "LEFT_OUT_OF is \"$left_out_of\"; everything or networks is allowed" >&2; exit 2; }

# without CAMERA: the names of the other cameras
without() { printf '%s\n' "${all[@]}" | grep -vx -- "$1" | paste -sd,; }

once described.yaml capture init "$recording" --out "$folder/described.yaml"
once detected/capture.yaml detect "$folder/described.yaml" --masks --out "$folder/detected"

# body PART CAMERAS: body, poses and their refinement from these cameras, prepared with the images of all cameras
body() {
  local out="$folder/$1" from
  follow "$1" --cameras "$2"
  for from in tracked refined; do
    once "$1/$from.yaml" capture amend "$out/$from" --cameras "$cameras" --out "$out/$from.yaml"
    once "$1/$from-prepared/capture.yaml" prepare "$out/$from.yaml" --mask-size 700 --image-size 512 \
      --out "$out/$from-prepared"
  done
}

# actor CAMERA: an actor that was trained without this camera
actor() {
  local camera="$1" others options seed
  others="$(without "$camera")"
  local part="$camera" here="$camera" seen="$others"
  [ "$left_out_of" = everything ] || { part=all here="all/$camera" seen="$cameras" && mkdir -p "$folder/$here"; }
  body "$part" "$seen"
  local out="$folder/$part"
  # The losses and the texture are those of kFilmSettings in tools/make_recipe.cpp.
  for seed in "${seeds[@]}"; do
    as_options seed="$seed" capture="$out/refined-prepared" {egnet,lighting,deltanet,texnet}.data.cameras="[$others]" \
      egnet.train.iterations="$(steps 4000)" lighting.train.iterations="$(steps 300)" \
      deltanet.train.iterations="$(steps 700)" texnet.train.iterations="$(steps 2500)" \
      egnet.loss.anchor=1e7 egnet.loss.arap=1500 texnet.model.size=256 texnet.model.detail=4
    train "$here/run-$seed" configs/small/ddc.yaml "${options[@]}"
    as_options seed="$seed" capture="$out/refined-prepared" ddc="$folder/$here/run-$seed" \
      gaussians.data.cameras="[$others]" gaussians.model.network=false gaussians.train.iterations=600
    train "$here/gaussians-$seed" configs/small/gaussians.yaml "${options[@]}"
    evaluate "$here/gaussians-$seed" "$here.new-$seed" --split test --every 4 --cameras "$camera"
    evaluate "$here/gaussians-$seed" "$here.trained-$seed" --split test --every 4 --cameras "$others"
  done
  [ -f "$folder/$here.before.json" ] || "$doppel" evaluate --capture "$out/tracked-prepared" --split test --every 4 \
    --cameras "$camera" --json >"$folder/$here.before.json"
}
for camera in "${left_out[@]}"; do actor "$camera"; done

list="[$(IFS=,; echo "${left_out[*]}")]"
if [ "$left_out_of" = networks ]; then
  list="all/$list" parts=(all)
else
  parts=("${left_out[@]}")
fi
{
  echo "| test frames | left-out camera | training cameras |"
  echo "|---|---:|---:|"
  echo "| AMVIoU, skinning before the refinement | {$list.before.json skinning AMVIoU 4} | |"
  for method in skinning egnet deltanet; do
    echo "| AMVIoU, \`$method\` | {$list.new-@.json $method AMVIoU 4} | {$list.trained-@.json $method AMVIoU 4} |"
  done
  for method in static lit texnet gaussians; do
    for figure in "PSNR 2" "SSIM 4" "sharpness 3"; do
      read -r key digits <<<"$figure"
      echo "| $key, \`$method\` | {$list.new-@.json $method $key $digits} | {$list.trained-@.json $method $key $digits} |"
    done
  done
  echo
  echo "| body and poses | keypoints of the training frames, px: tracked | refined |"
  echo "|---|---:|---:|"
  for part in "${parts[@]}"; do
    echo "| \`$part\` | {$part/tracked/track.json keypoint_error_px 2} | {$part/refined/track.json keypoint_error_px 2} |"
  done
} | write_table filmed "scripts/filmed.sh RECORDING $cameras"
