#!/usr/bin/env bash
# What each extra of the presets `small` adds to the chain of the thesis, alone and with the others, for three seeds.
# The runs choose nothing: all frames of the training split train, and the test split is evaluated once.
#   scripts/extras.sh CAPTURE [FOLDER [GROUP ...]]   default: the folder extras, all groups; resumes after an interruption
#     geometry   EGNet, its inputs and its masks: AMVIoU in all cameras
#     training   EGNet, the weights of its losses and what keeps it from overfitting: AMVIoU in all cameras
#     texture    TexNet on the chain of the thesis: MSE in the mask
#     hybrid     the hybrid on that chain, three frames: PSNR, SSIM, AMVIoU and distance from the ground truth in new cameras
# CAMERAS=0,1,2,3,4,5 (the default) are trained on. SEEDS="1 2 3" (the default). STEPS=1500 (the default) are the steps of
# EGNet. HELD_OUT=6,7 (the default) are the new cameras of the hybrid, SHARE=1 (the default) is the share of its steps that
# is made. JOBS=2 (the default) runs are trained side by side, with one thread and up to 5 GB each.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,13s/^# //p' "$0" >&2; exit 2; }
capture="$1" folder="${2:-extras}" groups=("${@:3}")
[ ${#groups[@]} -gt 0 ] || groups=(geometry training texture hybrid)
cameras="${CAMERAS:-0,1,2,3,4,5}" steps="${STEPS:-1500}"
source scripts/figures.sh
mkdir -p "$folder"
for size in 350 700; do
  "$doppel" prepare "$capture" --mask-size $size --out "$folder/prepared-$size" >/dev/null
done

# variant NAME SEED MASKS STAGES [key=value ...]: trains a variant and evaluates it on the test split
variant() {
  local run="$1-$2" stage cameras_of=() options
  for stage in ${4//,/ }; do cameras_of+=("$stage.data.cameras=[$cameras]"); done
  as_options seed="$2" capture="$folder/prepared-$3" egnet.train.iterations="$steps" "${cameras_of[@]}" "${@:5}"
  [ -f "$folder/$run.json" ] || train "$run" configs/ablation/thesis.yaml "${options[@]}" --stages "$4"
  evaluate "$run" "$run" --split test --every 2
}

# row TITLE NAME METHOD METRIC DIGITS: a line of a table
row() { echo "| $1 | {$2-@.json $3 $4 $5} |"; }

pass=  # of geometry_variant and its like: `train` starts the trainings, `row` prints the row

weights=(egnet.loss.model_to_data=30 egnet.loss.arap=300)
inertia=(egnet.model.inertia=12)
outline=(egnet.loss.boundary=outline)
noise=(egnet.data.pose_noise=0.07 egnet.data.input_noise=0.06)
window=(egnet.model.past_frames=6)
norm=(egnet.model.standardise=true egnet.model.recalibrate_norm=true)
decay=(egnet.train.weight_decay=0.7 egnet.train.mean_weights=0.995)
together=("${inertia[@]}" "${outline[@]}" "${noise[@]}" "${window[@]}" "${norm[@]}" "${decay[@]}" egnet.loss.arap=300
  egnet.loss.silhouette=260 egnet.loss.model_to_data=72)

# geometry_variant TITLE NAME MASKS [key=value ...]: starts the trainings of a variant, or prints its row
geometry_variant() {
  local seed
  if [ "$pass" = row ]; then row "$1" "$2" egnet AMVIoU 4; return; fi
  for seed in "${seeds[@]}"; do side_by_side variant "$2" "$seed" "$3" egnet "${@:4}"; done
}

geometry_variants() {
  geometry_variant "the thesis" thesis 350
  geometry_variant "\`inertia: 12\`" inertia 350 "${inertia[@]}"
  geometry_variant "\`boundary: outline\`" outline 350 "${outline[@]}"
  geometry_variant "masks of 700 pixels" masks 700
  geometry_variant "\`boundary: outline\`, masks of 700 pixels" outline-masks 700 "${outline[@]}"
  geometry_variant "all of both tables together" together 700 "${together[@]}"
  geometry_variant "all but \`inertia\`" without-inertia 700 "${together[@]}" egnet.model.inertia=0
}

training_variants() {
  geometry_variant "the thesis" thesis 350
  geometry_variant "\`model_to_data: 30\`, \`arap: 300\`" weights 350 "${weights[@]}"
  geometry_variant "noise on the inputs" noise 350 "${noise[@]}"
  geometry_variant "\`past_frames: 6\`" window 350 "${window[@]}"
  geometry_variant "\`standardise\`, \`recalibrate_norm\`" norm 350 "${norm[@]}"
  geometry_variant "weight decay, mean of the weights" decay 350 "${decay[@]}"
}

# geometry_table VARIANTS: trains them and prints their table
geometry_table() {
  pass=train "$1" >&2
  all_done
  echo "| EGNet, $steps steps | AMVIoU |"
  echo "|---|---:|"
  row "pure skinning" thesis skinning AMVIoU 4
  pass=row "$1"
}

geometry() { geometry_table geometry_variants; }
training() { geometry_table training_variants; }

# texture_variant TITLE NAME [key=value ...]: on the geometry and lighting of the chain of the thesis with the same seed
texture_variant() {
  local seed stage sets
  if [ "$pass" = row ]; then row "$1" "$2" texnet MSE 2; return; fi
  for seed in "${seeds[@]}"; do
    sets=()
    for stage in egnet lighting deltanet; do sets+=("$stage={run: $(realpath "$folder")/chain-$seed}"); done
    side_by_side variant "$2" "$seed" 350 texnet "${sets[@]}" "${@:3}"
  done
}

texture_variants() {
  texture_variant "\`residual\`" residual texnet.model.residual=true
  texture_variant "\`residual\`, \`lit\`" lit texnet.model.residual=true texnet.model.lit=true
  texture_variant "\`surface_normals\`" normals texnet.model.surface_normals=true
  texture_variant "\`distance: squares\`" squares texnet.loss.distance=squares
  texture_variant "all together" textures texnet.model.residual=true texnet.model.lit=true \
    texnet.model.surface_normals=true texnet.loss.distance=squares
}

# chains: trains the chain of the thesis with every seed
chains() {
  local seed
  for seed in "${seeds[@]}"; do side_by_side variant chain "$seed" 350 egnet,lighting,deltanet,texnet; done
  all_done
}

texture() {
  chains >&2
  pass=train texture_variants >&2
  all_done
  echo "| dynamic texture, 800 steps | masked MSE |"
  echo "|---|---:|"
  row "static texture" chain static MSE 2
  row "static texture under learnt lighting" chain lit MSE 2
  row "the thesis" chain texnet MSE 2
  pass=row texture_variants
}

# hybrid_run NAME SEED [key=value ...]: trains the hybrid on three frames and evaluates it in the cameras $held_out
held_out="${HELD_OUT:-6,7}"
hybrid_run() {
  local run="$1-$2" frames=8,24,40 options
  as_options seed="$2" capture="$folder/prepared-350" ddc="$(realpath "$folder")/chain-$2" \
    "radiance.rounds=[{field: $(steps 1600), refine: $(steps 150), variance: 0.01},
                      {field: $(steps 400), refine: $(steps 100), variance: 0.1}]" \
    "radiance.data.cameras=[$cameras]" "radiance.data.frames=[$frames]" "${@:3}"
  [ -f "$folder/$run.json" ] || train "$run" configs/small/hybrid.yaml "${options[@]}" --stages radiance
  evaluate "$run" "$run" --split train --frames $frames --cameras "$held_out"
}

# hybrid_variant TITLE NAME [key=value ...]: starts the trainings of a variant, or prints its row
hybrid_variant() {
  local seed
  if [ "$pass" = train ]; then
    for seed in "${seeds[@]}"; do side_by_side hybrid_run "$2" "$seed" "${@:3}"; done
    return
  fi
  echo "| $1 | {$2-@.json radiance PSNR 2} | {$2-@.json radiance SSIM 4} |" \
    "{$2-@.json refined AMVIoU 4} | {$2-@.json refined surface_distance_mm 2} |"
}

none=(radiance.loss.anchor=0 radiance.model.field.place_octaves=0 radiance.model.field.view_dependent=true)
hybrid_variants() {
  hybrid_variant "none of the three" hybrid-none "${none[@]}"
  hybrid_variant "\`anchor: 3e6\`" hybrid-anchor "${none[@]}" radiance.loss.anchor=3e6
  hybrid_variant "\`place_octaves: 8\`" hybrid-place "${none[@]}" radiance.model.field.place_octaves=8
  hybrid_variant "\`view_dependent: false\`" hybrid-view "${none[@]}" radiance.model.field.view_dependent=false
  hybrid_variant "all three" hybrid-all
}

hybrid() {
  chains >&2
  pass=train hybrid_variants >&2
  all_done
  echo "| hybrid, cameras $held_out | PSNR | SSIM | AMVIoU | distance from the ground truth, mm |"
  echo "|---|---:|---:|---:|---:|"
  pass=row hybrid_variants
}

for group in "${groups[@]}"; do
  "$group" >"$folder/$group.md.part"
  write_table "$group" "scripts/extras.sh CAPTURE" <"$folder/$group.md.part"
  rm "$folder/$group.md.part"
done
