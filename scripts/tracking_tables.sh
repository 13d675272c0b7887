#!/usr/bin/env bash
# Tables 5.1 and 5.2 (poses and surfaces of every method from one camera, and of the multi-view fit), with and without
# smoothing over five frames, by the protocol of 5.8.3 and 5.8.4: 14 joints, bones rescaled, surfaces of one-camera
# methods at the true position.
#   scripts/tracking_tables.sh CAPTURE RUN SEQUENCE [FOLDER]
# RUN is a run of the chain deepcap on another sequence of the capture; SEQUENCE is the test sequence of the capture.
# LiveCap has the keypoints and joints in space of `doppel detect`, which sees the images only.
# CAMERA=0 is the input camera; POSES=10 and SURFACES=100 are the steps between compared frames (as in the thesis).
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 3 ] || { sed -n '2,8s/^# //p' "$0" >&2; exit 2; }
capture="$1" run="$2" sequence="$3" folder="${4:-tracking-tables}"
camera="${CAMERA:-0}" poses="${POSES:-10}" surfaces="${SURFACES:-100}"
source scripts/figures.sh
mkdir -p "$folder"
"$doppel" prepare "$capture" --out "$folder/prepared" >/dev/null

# track NAME [METHOD] CAPTURE [option ...]: tracks once
track() {
  [ -f "$folder/$1/track.json" ] ||
    "$doppel" track "${@:2}" --sequences "$sequence" --vertices --out "$folder/$1" >/dev/null
}

# measure NAME INPUT SMOOTHING EVERY FILE
measure() {
  local input=()
  [ -z "$2" ] || input=(--input-camera "$2")
  "$doppel" evaluate --tracked "$folder/$1" --capture "$folder/prepared" "${input[@]}" --smoothing "$3" --every "$4" \
    --json >"$folder/$5.json"
}

# rows TITLE NAME INPUT SURFACE: lines of both tables; SURFACE is the row of the evaluation with the surface
rows() {
  local smoothing label file
  for smoothing in 0 1; do
    label=$([ $smoothing = 0 ] && echo "$1" || echo "$1, smoothed")
    measure "$2" "$3" $smoothing "$poses" "$2-$smoothing-poses"
    measure "$2" "$3" $smoothing "$surfaces" "$2-$smoothing-surfaces"
    file="$2-$smoothing-poses.json pose"
    echo "| $label | {$file GLE_mm 1} | {$file 3DPCK 1} | {$file AUC 1} | {$file MPJPE_mm 1} |" >>"$folder/5.1.md"
    file="$2-$smoothing-surfaces.json $4"
    echo "| $label | {$file AMVIoU 4} | {$file RVIoU 4} | {$file SVIoU 4} |" >>"$folder/5.2.md"
  done
}

[ -f "$folder/detected/capture.yaml" ] || "$doppel" detect "$capture" --out "$folder/detected" >/dev/null
fit=(--set smoothing=0 --sheet-frames 0)
track livecap livecap "$folder/detected" --camera "$camera" "${fit[@]}"
track livecap-paper livecap "$folder/detected" --camera "$camera" --config configs/paper/livecap.yaml "${fit[@]}"
track livecap-2d livecap "$capture" --camera "$camera" "${fit[@]}"
track deepcap deepcap "$capture" --camera "$camera" --run "$run" --smoothing 0
track multiview "$capture" --surface "${fit[@]}"
printf '%s\n' "| Table 5.1 | GLE, mm | 3DPCK, % | AUC, % | MPJPE, mm |" "|---|---:|---:|---:|---:|" >"$folder/5.1.md"
printf '%s\n' "| Table 5.2 | AMVIoU | RVIoU | SVIoU |" "|---|---:|---:|---:|" >"$folder/5.2.md"
rows "LiveCap, \`configs/paper\`" livecap-paper "$camera" surface
rows "LiveCap" livecap "$camera" surface
rows "LiveCap, keypoints of the capture, no joints in space" livecap-2d "$camera" surface
rows "skinning in the pose of DeepCap" deepcap "$camera" pose
rows "DeepCap" deepcap "$camera" surface
rows "multi-view fit" multiview "" surface
for table in 5.1 5.2; do
  write_table "table-$table" "scripts/tracking_tables.sh CAPTURE RUN SEQUENCE" <"$folder/$table.md"
done
