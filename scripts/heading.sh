#!/usr/bin/env bash
# The hybrid with and without the heading in its motion features (6.12.3.2, 6.25), on a synthetic person who turns once
# in each take. The studio light comes from one side, so the colour of a point depends on the heading.
#   scripts/heading.sh [FOLDER]     default: the folder heading; resumes after an interruption
# SEEDS="1 2 3" (the default). JOBS=2 (the default) runs are trained side by side, with one thread each.
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-heading}"
source scripts/figures.sh
mkdir -p "$folder"
cameras="[0,1,2,3,4,5,6]" new_camera=7
trained=$(seq -s, 0 6 114) some_trained=0,18,36,54,72,90,108 between=3,21,39,57,75,93,111

[ -f "$folder/capture/capture.yaml" ] || "$doppel" synth --preset small --turn 150 --out "$folder/capture"
"$doppel" prepare "$folder/capture" --out "$folder/prepared" >/dev/null

# ddc SEED: the geometry and lighting below the radiance field
ddc() {
  local options
  as_options seed="$1" capture="$folder/prepared" {egnet,lighting,deltanet}.data.cameras="$cameras"
  train "ddc-$1" configs/ablation/ddc.yaml "${options[@]}" --stages egnet,lighting,deltanet
}

# hybrid HEADING SEED
hybrid() {
  local run="$1-$2" options
  as_options seed="$2" capture="$folder/prepared" ddc="$(realpath "$folder")/ddc-$2" radiance.data.cameras="$cameras" \
    radiance.data.frames="[$trained]" radiance.data.image_size=384 radiance.model.motion.heading="$1"
  train "$run" configs/small/hybrid.yaml "${options[@]}"
  evaluate "$run" "$run.trained" --split train --frames "$some_trained" --cameras $new_camera
  evaluate "$run" "$run.between" --split train --frames "$between" --cameras $new_camera
}

for seed in "${seeds[@]}"; do side_by_side ddc "$seed"; done
all_done
for seed in "${seeds[@]}"; do for heading in kept removed; do side_by_side hybrid $heading "$seed"; done; done
all_done

# row TITLE HEADING
row() {
  echo "| $1 | {$2-@.trained.json radiance PSNR 2} | {$2-@.trained.json radiance SSIM 4}" \
    "| {$2-@.between.json radiance PSNR 2} | {$2-@.between.json radiance SSIM 4} |"
}
{
  echo "| heading | PSNR, trained frames | SSIM | PSNR, frames between them | SSIM |"
  echo "|---|---:|---:|---:|---:|"
  row "kept (thesis)" kept
  row "removed" removed
} | write_table heading "scripts/heading.sh"
