#!/usr/bin/env bash
# One frame of the synthetic person: the mesh refined with and without the radiance field's point clouds (Table 6.6),
# and novel views of the radiance field compared with a field without a mesh (6.12.5.2).
#   scripts/refinement.sh [FOLDER]     default: ablations, as written by scripts/ablations.sh; resumes after an interruption
# One seed. SHARE=1 (the default) of the steps of configs/ablation/hybrid.yaml are made: 0.5 takes half of the time.
# JOBS=2 (the default) runs are trained side by side, with one thread each.
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-ablations}"
source scripts/figures.sh
[ -d "$folder/ours-1" ] || { echo "$folder holds no run \`ours-1\`: run scripts/ablations.sh $folder first" >&2; exit 1; }

frame=40
held_out=7,19

# The person and motion of the run `ours-1`, with more cameras.
[ -f "$folder/ring/capture.yaml" ] || "$doppel" synth --preset small --cameras 24 --out "$folder/ring"
"$doppel" prepare "$folder/ring" --out "$folder/ring-prepared" >/dev/null

# variant NAME STAGES [key=value ...]: trains and evaluates once
variant() {
  local options
  as_options capture="$folder/ring-prepared" ddc="$(realpath "$folder")/ours-1" "${@:3}"
  train "$1" configs/ablation/hybrid.yaml "${options[@]}" --stages "$2"
  evaluate "$1" "$1" --split train --frames $frame --cameras $held_out
}

geometry() { echo "{$1.json $2 seen_distance_mm 2} | {$1.json $2 surface_distance_mm 2} | {$1.json $2 Hausdorff_mm 1} | {$1.json $2 AMVIoU 4}"; }
cloud() { printf ' {%s.json cloud %s 2} |' "$1" surface_distance_mm "$1" median_mm "$1" noise_mm "$1" p99_mm "$1" points; }
image_scores() { echo "{three.json $1 PSNR 2} | {three.json $1 SSIM 4} | {three.json $1 seconds 2}"; }

# round FIELD REFINE VARIANCE: a round
round() { echo "{field: $(steps "$1"), refine: $(steps "$2"), variance: $3}"; }
first=$(round 1500 300 0.01) next=$(round 700 200 0.1)
side_by_side variant without radiance "radiance.rounds=[$(round 0 700 0.01)]" radiance.loss.chamfer=0
side_by_side variant one radiance "radiance.rounds=[$first]"
side_by_side variant two radiance "radiance.rounds=[$first, $next]"
side_by_side variant three radiance,nerf "radiance.rounds=[$first, $next, $next]" nerf.train.iterations="$(steps 2200)"
all_done

{
  echo "| Table 6.6 | off the true surface where cameras see it, mm | everywhere, mm | Hausdorff, mm | AMVIoU |"
  echo "|---|---:|---:|---:|---:|"
  echo "| DDC | $(geometry three deltanet) |"
  echo "| refined without the clouds, $(steps 700) steps | $(geometry without refined) |"
  echo "| refined with them, one round ($(steps 300) steps) | $(geometry one refined) |"
  echo "| two rounds ($(steps 500)) | $(geometry two refined) |"
  echo "| three rounds ($(steps 700)) | $(geometry three refined) |"
  echo
  echo "| point clouds (Fig. 6.16): distance to the true surface | mean, mm | median, mm | root mean square, mm | 99 % below, mm | points a cloud |"
  echo "|---|---:|---:|---:|---:|---:|"
  echo "| one round |$(cloud one)"
  echo "| two rounds |$(cloud two)"
  echo "| three rounds |$(cloud three)"
  echo
  echo "| novel views | PSNR | SSIM | seconds an image |"
  echo "|---|---:|---:|---:|"
  echo "| dynamic texture | $(image_scores texnet) |"
  echo "| field without a mesh | $(image_scores nerf) |"
  echo "| field around the mesh | $(image_scores radiance) |"
} | write_table refinement "scripts/refinement.sh ablations"
