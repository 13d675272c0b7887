#!/usr/bin/env bash
# Learning curve (docs/results/scale.md): EGNet of configs/small/ddc.yaml on the first 250, 500, 1,000 and all 3,000 training
# frames of doppel synth --preset studio, judged on the test movements of all. Seeds SEEDS="1 2 3" for the smallest and the
# largest number, the first of them for the others.
#   scripts/learning_curve.sh FOLDER [CLOTH]     xpbd (default) or springs; SIZES="250 500 1000 3000"; STEPS=2500
# Two hours on two cores. Resumes after an interruption.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
folder="$1" cloth="${2:-xpbd}"
read -ra sizes <<<"${SIZES:-250 500 1000 3000}"
source scripts/figures.sh
mkdir -p "$folder"
once "$cloth/capture.yaml" synth --preset studio --cloth "$cloth" --out "$folder/$cloth"
all="$cloth-${sizes[-1]}"
for frames in "${sizes[@]}"; do
  once "$cloth-$frames/capture.yaml" prepare "$folder/$cloth" --limit-frames "$frames" --image-size 384 \
    --out "$folder/$cloth-$frames"
done

# learn FRAMES SEED
learn() {
  local options run="egnet-$cloth-$1-$2"
  as_options capture="$folder/$cloth-$1" seed="$2" egnet.train.iterations="${STEPS:-2500}"
  train "$run" configs/small/ddc.yaml --stages egnet "${options[@]}"
  evaluate "$run" "$run" --capture "$folder/$all" --split test --every 5
}
ends=("${sizes[0]}" "${sizes[-1]}")
for seed in "${seeds[@]}"; do
  for frames in "${sizes[@]}"; do
    if [ "$seed" = "${seeds[0]}" ] || [[ " ${ends[*]} " == *" $frames "* ]]; then side_by_side learn "$frames" "$seed"; fi
  done
done
all_done

{
  echo "| $cloth, training frames | AMVIoU | vertices, mm | distance, mm | normals, degrees | roughness error, mm |"
  echo "|---|---:|---:|---:|---:|---:|"
  # row TITLE FILE METHOD
  row() {
    local f="$2.json $3"
    echo "| $1 | {$f AMVIoU 4} | {$f vertex_error_mm 1} | {$f surface_distance_mm 1} | {$f normal_error_deg 1} | {$f roughness_error_mm 2} |"
  }
  row skinning "egnet-$cloth-${sizes[0]}-${seeds[0]}" skinning
  for frames in "${sizes[@]}"; do
    if [[ " ${ends[*]} " == *" $frames "* ]]; then seed=@; else seed="${seeds[0]}"; fi
    row "EGNet, $frames" "egnet-$cloth-$frames-$seed" egnet
  done
} | write_table "curve-$cloth" "scripts/learning_curve.sh FOLDER $cloth"
