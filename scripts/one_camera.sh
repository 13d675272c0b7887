#!/usr/bin/env bash
# LiveCap on one camera of a capture with a known motion, judged by the other cameras and by the motion
# (docs/results/chapter4.md, "One camera, seen from the others"). The joints in space are those of `doppel detect`.
#   scripts/one_camera.sh CAPTURE [FOLDER [CAMERA ...]]     default: the folder one-camera, cameras 0 2 4 6
# CAPTURE has masks, keypoints, and a motion in its sequences for training and for tests. Writes one-camera.md; resumes
# after an interruption.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
capture="$1" folder="${2:-one-camera}"
cameras=("${@:3}")
[ ${#cameras[@]} -gt 0 ] || cameras=(0 2 4 6)
SEEDS="${cameras[*]}" # the tables are means over the cameras
source scripts/figures.sh
mkdir -p "$folder"

once joints/capture.yaml detect "$capture" --model heavy --no-hands --keep-keypoints --out "$folder/joints"
once prepared/capture.yaml prepare "$folder/joints" --mask-size 700 --out "$folder/prepared"

# sequences SPLIT: their names
sequences() { awk -v split_name="$1" '/- name:/ { name = $3 } $1 == "split:" && $2 == split_name { print name }' "$folder/joints/capture.yaml"; }
motion="$(awk '/- name:/ { train = 0 } $2 == "train" { train = 1 } train && $1 == "motion:" { print $2; exit }' "$folder/joints/capture.yaml")"
[ -n "$motion" ] || { echo "$capture has no motion in a sequence for training" >&2; exit 1; }
root="$(sed -n 's/^root: //p' "$folder/joints/capture.yaml")"
[ "${root:0:1}" = / ] || root="$folder/joints/$root"
[ "${motion:0:1}" = / ] || motion="$root/$motion"

# tracked NAME SPLIT OPTION ...: tracks the split's sequences in each camera; judged at the true position and as it is
tracked() {
  local camera out names
  names="$(sequences "$2" | paste -sd,)"
  for camera in "${cameras[@]}"; do
    out="$1-$camera"
    once "$out/track.json" track livecap "$folder/joints" --camera "$camera" --sequences "$names" --vertices \
      --sheet-frames 0 "${@:3}" --out "$folder/$out"
    judge "$out" "$2" --input-camera "$camera"
    judge "$out.as-is" "$2"
  done
}
# judge NAME SPLIT OPTION ...: NAME.json
judge() {
  [ ! -f "$folder/$1.json" ] || return 0
  "$doppel" evaluate --capture "$folder/prepared" --split "$2" --tracked "$folder/${1%.as-is}" "${@:3}" --json \
    >"$folder/$1.json.part"
  mv "$folder/$1.json.part" "$folder/$1.json"
}
# row TITLE NAME
row() {
  echo "| $1 | {$2-@.json surface SVIoU 4} | {$2-@.json surface RVIoU 4} | {$2-@.as-is.json surface AMVIoU 4}" \
    "| {$2-@.json surface GLE_mm 0} | {$2-@.json surface MPJPE_mm 0} |"
}
heading() {
  echo "| $1, mean over cameras ${cameras[*]} | IoU, tracked camera | IoU, others, at the true position" \
    "| IoU, all, as it is | GLE, mm | MPJPE, mm |"
  echo "|---|---:|---:|---:|---:|---:|"
}
# part NAME TITLE [KEY=VALUE ...]: a row for the training sequences, with changed keys
part() {
  as_options "${@:3}"
  tracked "$1" train "${options[@]}"
  row "$2" "$1"
}

tracked unknown test --set joints.weight=91
tracked default test
tracked prior test --prior-motion "$motion"
{
  heading "test frames"
  row "joints trusted as those of an unknown network (\`joints.weight=91\`)" unknown
  row "defaults" default
  row "and \`--prior-motion\` of the training takes" prior
} | write_table one-camera "scripts/one_camera.sh CAPTURE"
{
  heading "training frames"
  part all defaults
  part no-filter "without the filter of the motion (\`motion.turn=0\`, \`temporal.weight=1.5\`, \`steady.weight=3000\`)" \
    motion.turn=0 temporal.weight=1.5 steady.weight=3000
  part no-floor "without the floor (\`floor.weight=0\`)" floor.weight=0
  part no-level "silhouette not levelled (\`silhouette.level=false\`)" silhouette.level=false
  part no-carry "last surfaces in the world (\`surface.carry=false\`)" surface.carry=false
  part no-template "without the skinned template as a target (\`surface.skinned.weight=0\`)" surface.skinned.weight=0
  part thesis "weights of the thesis (\`joints.weight=853\`: 28 a joint, \`silhouette.weight=200\`, \`prior.weight=500\`)" \
    joints.weight=853 silhouette.weight=200 prior.weight=500
} | write_table one-camera-parts "scripts/one_camera.sh CAPTURE"
