#!/usr/bin/env bash
# Domain adaptation (5.7) with the setting of the thesis and with ours, judged on frames of the clip that trained nothing
# and chose nothing.
#   scripts/adaptation.sh RUN CLIP [FOLDER]     default: the folder adaptation; resumes after an interruption
# RUN is a run of the chain `deepcap`, CLIP a capture with one camera. BATCH=90 and BATCH_DEFNET=50 (the defaults) are the
# batch sizes of the thesis. SEEDS="1 2 3" and JOBS=2 (the defaults) as in scripts/extras.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 2 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
studio="$1" clip="$2" folder="${3:-adaptation}"
source scripts/figures.sh
mkdir -p "$folder"
"$doppel" prepare "$clip" --image-size 256 --mask-size 192 --out "$folder/prepared" >/dev/null

# adapt NAME SEED CONFIG [key=value ...]
adapt() {
  local options
  as_options seed="$2" held_out=0.2 "${@:4}"
  [ -f "$folder/$1-$2/adapt.json" ] || "$doppel" adapt --run "$studio" --capture "$folder/prepared" --config "$3" "${options[@]}" \
    --out "$folder/$1-$2" >/dev/null 2>>"$folder/$1-$2.log" || { tail -3 "$folder/$1-$2.log" >&2; return 1; }
}

for seed in "${seeds[@]}"; do
  side_by_side adapt small "$seed" configs/small/adapt.yaml
  side_by_side adapt paper "$seed" configs/paper/adapt.yaml posenet.batch_size="${BATCH:-90}" defnet.batch_size="${BATCH_DEFNET:-50}"
done
all_done

# row TITLE NAME WHEN: the held-out frames before or after
row() {
  local part="$2-@/adapt.json 'held out, $3'"
  echo "| $1 | {$part posenet keypoint_error_px 1} | {$part defnet keypoint_error_px 1}" \
    "| {$part posenet AMVIoU 4} | {$part defnet AMVIoU 4} |"
}
{
  echo "| held-out frames | PoseNet, pixels | with DefNet, pixels | PoseNet, IoU | with DefNet, IoU |"
  echo "|---|---:|---:|---:|---:|"
  row "the networks of the studio" small before
  row "\`configs/paper/adapt.yaml\`, batches of ${BATCH:-90} and ${BATCH_DEFNET:-50}" paper after
  row "\`configs/small/adapt.yaml\`" small after
} | write_table adaptation "scripts/adaptation.sh RUN CLIP"
