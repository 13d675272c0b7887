#!/usr/bin/env bash
# The methods of one camera on a filmed person, for docs/results/filmed.md: LiveCap, and PoseNet with DefNet. The body is
# made from all cameras and all frames but the last quarter; the methods then see these frames in one camera and are judged
# in the others.
#   scripts/filmed_one_camera.sh RECORDING CAMERA [FOLDER]     default: the folder filmed-one; resumes after an interruption
# RECORDING holds videos and a calibration. SHARE=1 (the default) of the recipe's steps are made. SEEDS=1 (the default
# here).
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 2 ] || { sed -n '2,8s/^# //p' "$0" >&2; exit 2; }
recording="$1" camera="$2" folder="${3:-filmed-one}"
export SEEDS="${SEEDS:-1}"
source scripts/figures.sh
unset OMP_NUM_THREADS
mkdir -p "$folder"

# judge NAME OPTIONS ...: NAME.json, surfaces at the true position; NAME.as-is.json, where the method put them
judge() {
  [ -f "$folder/$1.json" ] || "$doppel" evaluate --capture "$folder/prepared" --split test --input-camera "$camera" \
    "${@:2}" --json >"$folder/$1.json"
  [ -f "$folder/$1.as-is.json" ] || "$doppel" evaluate --capture "$folder/prepared" --split test --cameras "$others" \
    "${@:2}" --json >"$folder/$1.as-is.json"
}

once described.yaml capture init "$recording" --out "$folder/described.yaml"
once detected/capture.yaml detect "$folder/described.yaml" --masks --out "$folder/detected"
follow .
once prepared/capture.yaml prepare "$folder/refined" --mask-size 700 --image-size 512 --out "$folder/prepared"
once small/capture.yaml prepare "$folder/refined" --mask-size 192 --image-size 256 --out "$folder/small"
others="$(sed -n 's/^cameras: \[\(.*\)\]/\1/p' "$folder/refined/capture.yaml" | tr -d ' ' | tr , '\n' | grep -vx -- "$camera" |
  paste -sd,)"
test="$(sed -n 's/^  - name: \(.*_test\)$/\1/p' "$folder/refined/capture.yaml" | paste -sd,)"
train="$(sed -n 's/^  - name: \(.*\)$/\1/p' "$folder/refined/capture.yaml" | grep -v _test | head -1)"

# livecap NAME OPTIONS ...
livecap() {
  once "$1/track.json" track livecap "$folder/refined" --camera "$camera" --sequences "$test" --vertices --sheet-frames 0 \
    "${@:2}" --out "$folder/$1"
  judge "$1" --tracked "$folder/$1"
}
livecap livecap
livecap livecap-prior --prior-motion "$folder/refined/$train.motion"

for seed in "${seeds[@]}"; do
  as_options seed="$seed" capture="$folder/small" defnet.train.iterations="$(steps 320)" posenet.train.max_minutes=120
  for phase in 0:900 1:400 2:200; do
    options+=(--set "posenet.phases.${phase%:*}.iterations=$(steps "${phase#*:}")")
  done
  train "deepcap-$seed" configs/small/deepcap.yaml "${options[@]}"
  evaluate "deepcap-$seed" "deepcap-$seed" --capture "$folder/prepared" --split test --every 2 --input-camera "$camera"
done

{
  echo "| test frames, seen in one camera | other cameras, at the true position | as it is | GLE, mm | MPJPE, mm |"
  echo "|---|---:|---:|---:|---:|"
  for row in "LiveCap livecap" "LiveCap~with~\`--prior-motion\` livecap-prior"; do
    read -r title name <<<"$row"
    echo "| ${title//\~/ } | {$name.json surface RVIoU 4} | {$name.as-is.json surface AMVIoU 4}" \
      "| {$name.json surface GLE_mm 0} | {$name.json surface MPJPE_mm 0} |"
  done
  echo "| PoseNet | {deepcap-@.json posenet RVIoU 4} | | {deepcap-@.json posenet GLE_mm 0} | {deepcap-@.json posenet MPJPE_mm 0} |"
  echo "| with DefNet | {deepcap-@.json defnet RVIoU 4} | | {deepcap-@.json defnet GLE_mm 0} | {deepcap-@.json defnet MPJPE_mm 0} |"
  echo "| fit to all cameras | {livecap.json skinning RVIoU 4} | | | |"
} | write_table filmed-one "scripts/filmed_one_camera.sh RECORDING $camera"
