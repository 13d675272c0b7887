#!/usr/bin/env bash
# What each extra of the presets `small` adds to the chain of the thesis, alone and with the others, for three seeds.
# The runs choose nothing: all frames of the training split train, and the test split is evaluated once.
#   scripts/extras.sh CAPTURE [FOLDER [GROUP ...]]   default: the folder extras, all groups; resumes after an interruption
#     geometry   EGNet: AMVIoU in all cameras                       about three minutes a run on two cores
#     texture    TexNet on the chain of the thesis: MSE in the mask  about six minutes a run
# CAMERAS=0,1,2,3,4,5 (the default) are trained on. SEEDS="1 2 3" (the default).
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,8s/^# //p' "$0" >&2; exit 2; }
capture="$1" folder="${2:-extras}" groups=("${@:3}")
[ ${#groups[@]} -gt 0 ] || groups=(geometry texture)
cameras="${CAMERAS:-0,1,2,3,4,5}" seeds=(${SEEDS:-1 2 3})
source scripts/figures.sh
mkdir -p "$folder"
for size in 350 700; do
  "$doppel" prepare "$capture" --mask-size $size --out "$folder/prepared-$size" >/dev/null
done

# train NAME SEED MASKS STAGES [key=value ...]: trains a variant once and evaluates it on the test split
train() {
  local run="$1-$2" masks=$3 stages=$4 sets=(--set "seed=$2") stage change
  for stage in ${stages//,/ }; do sets+=(--set "$stage.data.cameras=[$cameras]"); done
  for change in "${@:5}"; do sets+=(--set "$change"); done
  [ -f "$folder/$run.json" ] && return
  "$doppel" train configs/ablation/thesis.yaml --set capture="$folder/prepared-$masks" "${sets[@]}" --stages "$stages" \
    --out "$folder/$run" >/dev/null
  "$doppel" evaluate --run "$folder/$run" --split test --every 2 --json >"$folder/$run.json.part"
  mv "$folder/$run.json.part" "$folder/$run.json"
}

# row TITLE NAME METHOD METRIC DIGITS: a line of a table
row() {
  local seed
  echo "| $1 | $(for seed in "${seeds[@]}"; do figure "$2-$seed.json" "$3" "$4" 6; echo; done | spread "$5") |"
}

# geometry_variant TITLE NAME MASKS [key=value ...]
geometry_variant() {
  local seed
  for seed in "${seeds[@]}"; do train "$2" "$seed" "$3" egnet "${@:4}"; done
  row "$1" "$2" egnet AMVIoU 4
}

weights=(egnet.loss.model_to_data=30 egnet.loss.arap=300)
inertia=(egnet.model.inertia=12)
outline=(egnet.loss.boundary=outline)
noise=(egnet.data.pose_noise=0.07 egnet.data.input_noise=0.06)
window=(egnet.model.past_frames=6)
norm=(egnet.model.standardise=true egnet.model.recalibrate_norm=true)
decay=(egnet.train.weight_decay=0.7 egnet.train.mean_weights=0.995)
together=("${inertia[@]}" "${outline[@]}" "${noise[@]}" "${window[@]}" "${norm[@]}" "${decay[@]}" egnet.loss.arap=300
  egnet.loss.silhouette=260 egnet.loss.model_to_data=72)

geometry() {
  echo "| EGNet, 1,500 steps | AMVIoU |"
  echo "|---|---:|"
  geometry_variant "the thesis" thesis 350
  row "pure skinning" thesis skinning AMVIoU 4
  geometry_variant "\`inertia: 12\`" inertia 350 "${inertia[@]}"
  geometry_variant "\`boundary: outline\`, masks of 700 pixels" outline 700 "${outline[@]}"
  geometry_variant "masks of 700 pixels" masks 700
  geometry_variant "\`model_to_data: 30\`, \`arap: 300\`" weights 350 "${weights[@]}"
  geometry_variant "noise on the inputs" noise 350 "${noise[@]}"
  geometry_variant "\`past_frames: 6\`" window 350 "${window[@]}"
  geometry_variant "\`standardise\`, \`recalibrate_norm\`" norm 350 "${norm[@]}"
  geometry_variant "weight decay, mean of the weights" decay 350 "${decay[@]}"
  geometry_variant "all together" together 700 "${together[@]}"
  geometry_variant "all but \`inertia\`" without-inertia 700 "${together[@]}" egnet.model.inertia=0
}

# texture_variant TITLE NAME [key=value ...]: on the geometry and lighting of the chain of the thesis with the same seed
texture_variant() {
  local seed stage sets
  for seed in "${seeds[@]}"; do
    sets=()
    for stage in egnet lighting deltanet; do sets+=("$stage={run: $(realpath "$folder")/chain-$seed}"); done
    train "$2" "$seed" 350 texnet "${sets[@]}" "${@:3}"
  done
  row "$1" "$2" texnet MSE 2
}

texture() {
  local seed
  for seed in "${seeds[@]}"; do train chain "$seed" 350 egnet,lighting,deltanet,texnet; done
  echo "| dynamic texture, 800 steps | masked MSE |"
  echo "|---|---:|"
  row "static texture" chain static MSE 2
  row "static texture under learnt lighting" chain lit MSE 2
  row "the thesis" chain texnet MSE 2
  texture_variant "\`residual\`" residual texnet.model.residual=true
  texture_variant "\`residual\`, \`lit\`" lit texnet.model.residual=true texnet.model.lit=true
  texture_variant "\`surface_normals\`" normals texnet.model.surface_normals=true
  texture_variant "\`distance: squares\`" squares texnet.loss.distance=squares
  texture_variant "all together" textures texnet.model.residual=true texnet.model.lit=true \
    texnet.model.surface_normals=true texnet.loss.distance=squares
}

for group in "${groups[@]}"; do
  { "$group"; provenance "scripts/extras.sh CAPTURE"; } | tee "$folder/$group.md"
done
