#!/usr/bin/env bash
# Compares `character.falloff` on training frames: trains EGNet of configs/small/ddc.yaml without the first take of the
# training sequence and judges on this take. The test split is not read.
#   scripts/choose_falloff.sh FOLDER [CAPTURE ...]     captures beside the synthetic ones; resumes after an interruption
# STEPS=1200 (the default). All cameras train, or CAMERAS=0,1,2 of the given captures. JOBS=2 (the default) runs are
# trained side by side, with one thread each. One seed. Half an hour on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
folder="$1" given=("${@:2}")
source scripts/figures.sh
mkdir -p "$folder"
once springs/capture.yaml synth --preset small --cloth springs --out "$folder/springs"
once xpbd/capture.yaml synth --preset small --cloth xpbd --out "$folder/xpbd"
captures=("$folder/springs" "$folder/xpbd" "${given[@]}")
variants=("hops truncated" "hops smooth" "geodesic smooth")

# learn CAPTURE METRIC FALLOFF
learn() {
  local name options changes=()
  name="$(basename "$1")"
  [[ $1 == "$folder"/* ]] || [ -z "${CAMERAS:-}" ] || changes=(egnet.data.cameras="[$CAMERAS]")
  as_options capture="$folder/$name-prepared" validation.takes=[0] egnet.train.iterations="${STEPS:-1200}" \
    character.metric="$2" character.falloff="$3" "${changes[@]}"
  train "$name-$2-$3" configs/small/ddc.yaml --stages egnet "${options[@]}"
  evaluate "$name-$2-$3" "$name-$2-$3" --split validation --every 4
}
for capture in "${captures[@]}"; do
  once "$(basename "$capture")-prepared/capture.yaml" prepare "$capture" --mask-size 700 \
    --out "$folder/$(basename "$capture")-prepared"
done
for capture in "${captures[@]}"; do
  for variant in "${variants[@]}"; do
    read -r metric falloff <<<"$variant"
    side_by_side learn "$capture" "$metric" "$falloff"
  done
done
all_done

{
  echo "| capture | \`character.metric\` | \`character.falloff\` | AMVIoU | vertices, mm | normals, degrees | roughness error, mm | roughness, of the true one |"
  echo "|---|---|---|---:|---:|---:|---:|---:|"
  for capture in "${captures[@]}"; do
    for variant in "${variants[@]}"; do
      read -r metric falloff <<<"$variant"
      f="$(basename "$capture")-$metric-$falloff.json egnet"
      echo "| $(basename "$capture") | $metric | $falloff | {$f AMVIoU 4} | {$f vertex_error_mm 1} | {$f normal_error_deg 1} | {$f roughness_error_mm 2} | {$f roughness_ratio 2} |"
    done
  done
} | write_table falloff "scripts/choose_falloff.sh FOLDER CAPTURE"
