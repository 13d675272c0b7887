#!/usr/bin/env bash
# A table to choose noise and loss weights of configs/quickstart/egnet.yaml by: trains without a share of the training
# frames and judges on it. The test split is not read.
#   scripts/choose_quickstart.sh [FOLDER]     default: the folder choose-quickstart; resumes after an interruption
# JOBS=2 (the default) runs are trained side by side, with one thread each. SEEDS="1 2 3" (the default).
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-choose-quickstart}"
source scripts/figures.sh
mkdir -p "$folder"
once capture/capture.yaml synth --preset small --out "$folder/capture"
once prepared/capture.yaml prepare "$folder/capture" --out "$folder/prepared"

# NAME, then the changed keys
candidates=(
  "preset"
  "no-noise data.pose_noise=0 data.input_noise=0"
  "pose-noise-0.14 data.pose_noise=0.14"
  "input-noise-0.06 data.input_noise=0.06"
  "arap-300 loss.arap=300"
  "arap-30 loss.arap=30"
  "model_to_data-72 loss.model_to_data=72"
)

# candidate SEED NAME [KEY=VALUE ...]
candidate() {
  local run="$2-$1" options
  as_options seed="$1" capture="$folder/prepared" validation.share=0.25 train.max_minutes=60 "${@:3}"
  train "$run" configs/quickstart/egnet.yaml "${options[@]}"
  evaluate "$run" "$run" --split validation
}
for row in "${candidates[@]}"; do
  read -ra words <<<"$row"
  for seed in "${seeds[@]}"; do side_by_side candidate "$seed" "${words[@]}"; done
done
all_done

{
  echo "| changed | AMVIoU, held-out training frames |"
  echo "|---|---:|"
  for row in "${candidates[@]}"; do
    read -r name keys <<<"$row"
    echo "| ${keys:-nothing} | {$name-@.json egnet AMVIoU 4} |"
  done
} | write_table quickstart "scripts/choose_quickstart.sh"
