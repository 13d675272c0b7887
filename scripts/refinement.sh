#!/usr/bin/env bash
# One frame of the synthetic person: the mesh refined with and without the radiance field's point clouds (Table 6.6),
# and novel views of the radiance field compared with a field without a mesh (6.12.5.2).
#   scripts/refinement.sh [FOLDER]     default: ablations, as written by scripts/ablations.sh; takes two hours, resumes
#                                      after an interruption
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-ablations}"
source scripts/figures.sh
[ -d "$folder/ours" ] || { echo "$folder holds no run \`ours\`: run scripts/ablations.sh $folder first" >&2; exit 1; }

frame=40
held_out=7,19

# The person and motion of the run `ours`, with more cameras.
[ -f "$folder/ring/capture.yaml" ] || "$doppel" synth --preset small --cameras 24 --out "$folder/ring"
"$doppel" prepare "$folder/ring" --out "$folder/ring-prepared" >/dev/null

# variant NAME STAGES [key=value ...]: trains and evaluates once
variant() {
  local name=$1 stages=$2 sets=() change
  shift 2
  for change in "$@"; do sets+=(--set "$change"); done
  "$doppel" train configs/ablation/hybrid.yaml --set capture="$folder/ring-prepared" --set ddc="$(realpath "$folder")/ours" \
    "${sets[@]}" --stages "$stages" --out "$folder/$name"
  "$doppel" evaluate --run "$folder/$name" --split train --frames $frame --cameras $held_out --json >"$folder/$name.json"
}

geometry() { echo "$(figure "$1.json" "$2" seen_distance_mm 2) | $(figure "$1.json" "$2" surface_distance_mm 2) | $(figure "$1.json" "$2" Hausdorff_mm 1) | $(figure "$1.json" "$2" AMVIoU 4)"; }
cloud() { echo "$(figure "$1.json" cloud surface_distance_mm 2) | $(figure "$1.json" cloud noise_mm 2)"; }
pictures() { echo "$(figure three.json "$1" PSNR 2) | $(figure three.json "$1" SSIM 4) | $(figure three.json "$1" seconds 2)"; }

variant without radiance 'radiance.rounds=[{field: 0, refine: 700}]' radiance.loss.chamfer=0
variant one radiance 'radiance.rounds=[{field: 1500, refine: 300, variance: 0.01}]'
variant two radiance 'radiance.rounds=[{field: 1500, refine: 300, variance: 0.01}, {field: 700, refine: 200, variance: 0.1}]'
variant three radiance,nerf

{
  echo "| Table 6.6 | off the true surface where cameras see it, mm | everywhere, mm | Hausdorff, mm | AMVIoU |"
  echo "|---|---:|---:|---:|---:|"
  echo "| DDC | $(geometry three deltanet) |"
  echo "| refined without the clouds | $(geometry without refined) |"
  echo "| refined with them, one round | $(geometry one refined) |"
  echo "| two rounds | $(geometry two refined) |"
  echo "| three rounds | $(geometry three refined) |"
  echo
  echo "| point clouds (Fig. 6.16) | off the true surface, mm | noise, mm |"
  echo "|---|---:|---:|"
  echo "| one round | $(cloud one) |"
  echo "| two rounds | $(cloud two) |"
  echo "| three rounds | $(cloud three) |"
  echo
  echo "| novel views | PSNR | SSIM | seconds a picture |"
  echo "|---|---:|---:|---:|"
  echo "| dynamic texture | $(pictures texnet) |"
  echo "| field without a mesh | $(pictures nerf) |"
  echo "| field around the mesh | $(pictures radiance) |"
} | tee "$folder/refinement.md"
