#!/usr/bin/env bash
# Trains or tracks on the studio capture and compares a figure with its threshold.
#   studio.sh livecap|egnet|ddc|hybrid DOPPEL SOURCE WORK
# The folder DOPPEL_SHARED holds the capture. WORK keeps runs, so that ddc builds on egnet and hybrid on ddc.
set -euo pipefail
figure=$1 doppel=$2 source=$3
work=$4/$(git -C "$source" rev-parse --short HEAD 2>/dev/null || echo unversioned)  # runs of another commit are not resumed
if [ -z "${DOPPEL_SHARED:-}" ]; then
  echo "SKIPPED: DOPPEL_SHARED is not set, so there is no studio capture"
  exit 77
fi
capture=$DOPPEL_SHARED/captures/s22
mkdir -p "$work"
cd "$work"
"$doppel" prepare "$capture" --mask-size 700 --out prepared >/dev/null

# value FILE KEY ...: a number of the JSON of `doppel evaluate` or `track`
value() { echo "{$* 6}" | "$source/scripts/tables.py" .; }
# expect NAME VALUE THRESHOLD
expect() {
  echo "$1: $2, at least $3 expected"
  awk -v value="$2" -v least="$3" 'BEGIN { exit !(value + 0 >= least + 0) }' || { echo "FAILED: $1" && exit 1; }
}
cameras="[0,1,2,3,4,5]"
chain=()
for stage in egnet lighting deltanet texnet; do chain+=(--set "$stage.data.cameras=$cameras"); done
train() { "$doppel" train "$source/configs/small/$1.yaml" --set capture="$work/prepared" "${@:2}"; }

case $figure in
  livecap)
    mkdir -p clip
    cat >clip/capture.yaml <<YAML
doppel_capture: 1
name: wild
root: $(realpath "$capture")
character: character/ddc.character
calibration: wild/camera.calibration
landmarks: landmarks.csv
sequences:
  - name: wild
    split: test
    videos: wild/videos/stream000.mp4
    background_subtraction: {frames: [0, 19]}
    keypoints: wild/keypoints/000/stream000_{frame:012}_keypoints.json
    joints3d: wild/joints3d.csv
    first_frame: 20
YAML
    "$doppel" track livecap clip --vertices --sheet-frames 0 --out tracked >/dev/null
    expect "IoU of the surface" "$(value tracked/track.json livecap IoU)" 0.948
    ;;
  egnet)
    train ddc "${chain[@]}" --stages egnet --out ddc
    "$doppel" evaluate --run ddc --every 2 --json >egnet.json
    expect "AMVIoU of EGNet" "$(value egnet.json egnet AMVIoU)" 0.9707
    ;;
  ddc)
    train ddc "${chain[@]}" --out ddc
    "$doppel" evaluate --run ddc --every 6 --json >ddc.json
    expect "AMVIoU of DeltaNet" "$(value ddc.json deltanet AMVIoU)" 0.9717
    expect "PSNR of the dynamic texture, dB" "$(value ddc.json texnet PSNR)" 31.5
    ;;
  hybrid)
    train hybrid --set ddc="$work/ddc" --set "radiance.data.cameras=$cameras" \
      --set "radiance.data.frames=[4,20,36,52,68,84,100,116,132,148]" --out hybrid
    "$doppel" evaluate --run hybrid --split train --frames 20,52,84,116,148 --cameras 6,7 --json >hybrid.json
    expect "PSNR in new cameras, dB" "$(value hybrid.json radiance PSNR)" 33.2
    ;;
esac
