#!/usr/bin/env bash
# Contribution of each part of the one-camera tracker (thesis 4.8.7): switches parts off one by one and writes a table.
#   scripts/livecap_ablations.sh [FOLDER [CAPTURE [options of `doppel track`]]]
# Default: the folder livecap-ablations, and one camera of the synthetic person. Existing variants are not run again.
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-livecap-ablations}"
doppel="${DOPPEL:-build/release/tools/doppel}"
[ -x "$doppel" ] || { scripts/install_dependencies.sh; cmake --preset release >/dev/null; cmake --build --preset release --target doppel; }

mkdir -p "$folder"
if [ $# -ge 2 ]; then
  capture="$2"
  options=("${@:3}")
else
  capture="$folder/capture"
  options=(--camera 0 --sequences testing)
  [ -f "$capture/capture.yaml" ] || "$doppel" synth --preset small --cameras 1 --frames 4 --test-frames 80 --out "$capture"
fi

# figure NAME KEY DIGITS: a number from the variant's track.json, or nothing if the key is missing
figure() { grep -o "\"$2\": [0-9.e-]*" "$folder/$1/track.json" | head -1 | cut -d' ' -f2 | xargs -r printf "%.$3f"; }

# variant NAME DESCRIPTION [key=value ...]: tracks once and adds a row to the table
variant() {
  local name=$1 description=$2 sets=() change lost
  shift 2
  for change in "$@"; do sets+=(--set "$change"); done
  [ -f "$folder/$name/track.json" ] ||
    "$doppel" track "$capture" --method livecap --config configs/track/livecap.yaml --vertices --sheet-frames 0 \
      "${options[@]}" "${sets[@]}" --out "$folder/$name" >/dev/null
  lost=$(grep -c '"state": "lost"' "$folder/$name/track.json" || true)
  echo "| $description | $(figure "$name" IoU_pose 4) | $(figure "$name" IoU 4) | $(figure "$name" keypoint_error_px 2)" \
    "| $(figure "$name" MPJPE_mm 1) | $(figure "$name" vertex_error_mm 1) | $lost |"
}

{
  echo "| without | IoU, pose | IoU, surface | keypoints, pixels | joints, mm | vertices, mm | lost |"
  echo "|---|---:|---:|---:|---:|---:|---:|"
  variant full "nothing"
  variant no-2d "2D keypoints" keypoints.weight=0
  variant no-faces "points of the face" keypoints.faces=false
  variant no-3d "joints in space" joints.weight=0
  variant no-silhouette "silhouette of the pose" silhouette.weight=0
  variant no-temporal "temporal term" temporal.weight=0
  variant no-steady "steady DoFs" steady.weight=0
  variant no-prior "prior" prior.weight=0
  variant no-limits "limits" limits.weight=0
  variant keypoints-only "silhouette of the pose, and the surface" silhouette.weight=0 surface.enabled=false
  variant pose-only "the surface" surface.enabled=false
  variant no-photometric "photometric term" surface.photometric.weight=0
  variant no-outline "silhouette of the surface" surface.silhouette.weight=0
  variant no-velocity "velocity, acceleration" surface.velocity.weight=0 surface.acceleration.weight=0
  variant no-warp "warping" surface.warp=false
  variant no-snap "snapping" surface.snap=false
  variant colours-only "silhouette of the surface, and snapping" surface.silhouette.weight=0 surface.snap=false
  variant no-parts "masks of parts" surface.silhouette.parts=false
  variant no-clamp "clamp of isolated vertices" surface.max_isolated_motion=0
  variant soft "materials: 2 everywhere" surface.materials=false surface.rigidity=2
  variant stiff "materials: 50 everywhere" surface.materials=false surface.rigidity=50
} | tee "$folder/table.md"
