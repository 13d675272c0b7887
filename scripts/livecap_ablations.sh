#!/usr/bin/env bash
# Contribution of each part of the one-camera tracker (thesis 4.8.7): the four bars of Fig. 4.16, and a table with parts
# switched off one by one. Writes fig-4.16.md and table.md.
#   scripts/livecap_ablations.sh [FOLDER [CAPTURE [options of `doppel track livecap`]]]
# Default: the folder livecap-ablations, and one camera of the synthetic person. Existing variants are not run again.
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-livecap-ablations}"
source scripts/figures.sh

mkdir -p "$folder"
if [ $# -ge 2 ]; then
  capture="$2"
  options=("${@:3}")
else
  capture="$folder/capture"
  options=(--camera 0 --sequences testing)
  [ -f "$capture/capture.yaml" ] || "$doppel" synth --preset small --cameras 1 --frames 4 --test-frames 80 --out "$capture"
fi

# run_variant NAME [key=value ...]: tracks once
run_variant() {
  local name=$1 sets=() change
  for change in "${@:2}"; do sets+=(--set "$change"); done
  [ -f "$folder/$name/track.json" ] ||
    "$doppel" track livecap "$capture" --vertices --sheet-frames 0 \
      "${options[@]}" "${sets[@]}" --out "$folder/$name" >/dev/null
}

# variant NAME DESCRIPTION [key=value ...]: a row of the table
variant() {
  local file=$1/track.json
  run_variant "$1" "${@:3}"
  echo "| $2 | {$file IoU_pose 4} | {$file IoU 4} | {$file keypoint_error_px 2} | {$file landmarks_mm 1}" \
    "| {$file vertex_error_mm 1} | {$file lost_frames 0} |"
}

# bar TITLE NAME KEY [key=value ...]: a bar of Fig. 4.16, the mean distance of vertices from the true surface
bar() {
  run_variant "$2" "${@:4}"
  echo "| $1 | {$2/track.json $3 1} |"
}

# Fig. 4.16 needs the true surface.
run_variant full
[ -z "$(figure full/track.json vertex_error_mm 1)" ] || {
  echo "| Fig. 4.16 | vertex error, mm |"
  echo "|---|---:|"
  bar "E_2D without faces + E_3D" bar-no-faces vertex_error_pose_mm keypoints.faces=false silhouette.weight=0 surface.enabled=false
  bar "E_2D + E_3D" keypoints-only vertex_error_pose_mm silhouette.weight=0 surface.enabled=false
  bar "E_pose" pose-only vertex_error_pose_mm surface.enabled=false
  bar "E_pose + E_non-rigid" full vertex_error_mm
} | write_table fig-4.16 "scripts/livecap_ablations.sh"

{
  echo "| without | IoU, pose | IoU, surface | keypoints, pixels | joints, mm | vertices, mm | lost |"
  echo "|---|---:|---:|---:|---:|---:|---:|"
  variant full "nothing"
  variant no-2d "2D keypoints" keypoints.weight=0
  variant no-faces "points of the face" keypoints.faces=false
  variant no-3d "joints in space" joints.weight=0
  variant no-silhouette "silhouette of the pose" silhouette.weight=0
  variant not-level "levelling of the silhouette" silhouette.level=false
  variant no-motion "filter of the motion; temporal and steady instead" motion.turn=0 temporal.weight=1.5 steady.weight=3000
  variant no-floor "floor" floor.weight=0
  variant no-prior "prior" prior.weight=0
  variant no-limits "limits" limits.weight=0
  variant keypoints-only "silhouette of the pose, and the surface" silhouette.weight=0 surface.enabled=false
  variant pose-only "the surface" surface.enabled=false
  variant no-photometric "photometric term" surface.photometric.weight=0
  variant no-outline "silhouette of the surface" surface.silhouette.weight=0
  variant no-velocity "velocity, acceleration" surface.velocity.weight=0 surface.acceleration.weight=0
  variant no-carry "velocity relative to the pose" surface.carry=false
  variant no-skinned "skinned template as a target" surface.skinned.weight=0
  variant no-warp "warping" surface.warp=false
  variant no-snap "snapping" surface.snap=false
  variant colours-only "silhouette of the surface, and snapping" surface.silhouette.weight=0 surface.snap=false
  variant no-parts "masks of parts" surface.silhouette.parts=false
  variant no-clamp "clamp of isolated vertices" surface.max_isolated_motion=0
  variant soft "materials: 2 everywhere" surface.materials=false surface.rigidity=2
  variant stiff "materials: 50 everywhere" surface.materials=false surface.rigidity=50
} | write_table table "scripts/livecap_ablations.sh"
