#!/usr/bin/env bash
# Trains the variants of the thesis's ablations on the synthetic person and writes their tables to FOLDER/tables_*.md.
#   scripts/ablations.sh [FOLDER] [TABLE ...]      default: ablations, both tables; resumes after an interruption
#     5.3   DeepCap with fewer cameras, with fewer frames, without DefNet
#     6.4   Tables 6.4 and 6.5 (6.9.5): parts of the actor, its cameras
# SEEDS="1 2 3" (the default). JOBS=2 (the default) runs are trained side by side, with one thread each.
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-ablations}"
tables=("${@:2}")
[ ${#tables[@]} -gt 0 ] || tables=(5.3 6.4)
for table in "${tables[@]}"; do
  [[ "$table" =~ ^(5.3|6.4)$ ]] || { echo "scripts/ablations.sh: there is no table '$table'; 5.3 and 6.4 can be made" >&2; exit 2; }
done
source scripts/figures.sh

[ -f "$folder/capture/capture.yaml" ] || "$doppel" synth --preset small --out "$folder/capture"
"$doppel" prepare "$folder/capture" --out "$folder/prepared" >/dev/null


# ---- Table 5.3 ----

# deepcap NAME SEED [key=value ...]: trains a variant; the keys belong to `data` of both networks. The test motion is
# captured from each camera in turn. Camera 0 is among the training cameras of all variants.
deepcap() {
  local run="deepcap-$1-$2" sets=() change camera options
  for change in "${@:3}"; do sets+=("posenet.data.$change" "defnet.data.$change"); done
  as_options seed="$2" capture="$folder/prepared" "${sets[@]}"
  train "$run" configs/ablation/deepcap.yaml "${options[@]}"
  for camera in 0 1 2 3 4 5 6 7; do evaluate "$run" "$run.$camera" --split test --every 2 --input-camera $camera; done
}
deepcaps() { for seed in "${seeds[@]}"; do side_by_side deepcap "$1" "$seed" "${@:2}"; done; }

# line TITLE NAME METHOD: a row of Table 5.3: from camera 0, and the mean over the cameras from which a run captures
line() {
  local all="deepcap-$2-@.[0,1,2,3,4,5,6,7].json"
  echo "| $1 | {deepcap-$2-@.0.json $3 3DPCK 1} | {deepcap-$2-@.0.json $3 AMVIoU 4} | {$all $3 3DPCK 1} | {$all $3 AMVIoU 4} |"
}

table_5_3() {
  deepcaps ours
  deepcaps cameras-1 "cameras=[0]"
  deepcaps cameras-2 "cameras=[0,2]"
  deepcaps cameras-3 "cameras=[0,2,5]"
  deepcaps quarter "frames=[$(seq -s, 0 4 119)]"
  deepcaps half "frames=[$(seq -s, 0 2 119)]"
  all_done
  {
    echo "| Table 5.3 | 3DPCK, camera 0 | AMVIoU, camera 0 | 3DPCK, all cameras | AMVIoU, all cameras |"
    echo "|---|---:|---:|---:|---:|"
    line "1 camera" cameras-1 defnet
    line "2 cameras" cameras-2 defnet
    line "3 cameras" cameras-3 defnet
    line "a quarter of the frames (30)" quarter defnet
    line "half of the frames (60)" half defnet
    line "PoseNet only" ours posenet
    line "ours (8 cameras, 120 frames)" ours defnet
  } | write_table tables_5.3 "scripts/ablations.sh ablations 5.3"
}

# ---- Tables 6.4 and 6.5 ----

# Camera 007 is never used for training. Only its images are compared.
held_out=7
cameras_6_5=(2 4 7)

# cameras N: names of N cameras spread over the ring, without the held-out camera
cameras() {
  local n=$1 i list=()
  for ((i = 0; i < n; ++i)); do list+=($((i * held_out / n))); done
  (IFS=,; echo "[${list[*]}]")
}

# ddc NAME SEED CAMERAS STAGES [key=value ...]: trains STAGES; earlier stages come from the variant `ours` of this seed
ddc() {
  local run="$1-$2" sets=() stage options
  for stage in egnet lighting deltanet texnet; do
    if [[ ",$4," == *",$stage,"* ]]; then
      sets+=("$stage.data.cameras=$3")
    elif [ "$stage" = egnet ] || [ "$stage" = lighting ]; then
      sets+=("$stage={run: $(realpath "$folder")/ours-$2}")
    fi
  done
  as_options seed="$2" capture="$folder/prepared" "${sets[@]}" "${@:5}"
  train "$run" configs/ablation/ddc.yaml "${options[@]}" --stages "$4"
  # Geometry is evaluated in all cameras, as AMVIoU requires; images in the held-out camera.
  evaluate "$run" "$run.all" --split test --every 4
  evaluate "$run" "$run.held" --split test --cameras $held_out
}
ddcs() { for seed in "${seeds[@]}"; do side_by_side ddc "$1" "$seed" "${@:2}"; done; }

amviou() { echo "{$1-@.all.json $2 AMVIoU 4}"; }
mse() { echo "{$1-@.held.json $2 MSE 1}"; }

table_6_4() {
  local all n run
  all=$(cameras $held_out)
  ddcs ours "$all" egnet,lighting,deltanet,texnet
  all_done
  ddcs fully-connected "$all" egnet,lighting,deltanet egnet.model.network=fully_connected deltanet.model.network=fully_connected
  ddcs unstructured "$all" egnet,lighting,deltanet egnet.model.network=chebyshev deltanet.model.network=chebyshev
  ddcs global "$all" deltanet deltanet.model.space=global
  ddcs no-chroma "$all" deltanet deltanet.loss.chroma=0
  for n in "${cameras_6_5[@]}"; do
    [ "$n" = $held_out ] || ddcs "cameras-$n" "$(cameras "$n")" egnet,lighting,deltanet,texnet
  done
  all_done
  {
    echo "| Table 6.4 | AMVIoU | MSE |"
    echo "|---|---:|---:|"
    echo "| pure skinning | $(amviou ours skinning) | |"
    echo "| EGNet only | $(amviou ours egnet) | |"
    echo "| fully connected | $(amviou fully-connected deltanet) | |"
    echo "| unstructured graph convolution | $(amviou unstructured deltanet) | |"
    echo "| global pose space | $(amviou global deltanet) | |"
    echo "| without lighting and dynamic texture | | $(mse ours static) |"
    echo "| without dynamic texture | | $(mse ours lit) |"
    echo "| ours | $(amviou ours deltanet) | $(mse ours texnet) |"
    echo
    echo "| Table 6.5 | AMVIoU | MSE |"
    echo "|---|---:|---:|"
    for n in "${cameras_6_5[@]}"; do
      run=$([ "$n" = $held_out ] && echo ours || echo "cameras-$n")
      echo "| $n cameras | $(amviou "$run" deltanet) | $(mse "$run" texnet) |"
    done
    echo
    echo "| chroma loss (6.9.5) | AMVIoU | MSE, static texture under light |"
    echo "|---|---:|---:|"
    echo "| without | $(amviou no-chroma deltanet) | $(mse no-chroma lit) |"
    echo "| with | $(amviou ours deltanet) | $(mse ours lit) |"
  } | write_table tables_6.4 "scripts/ablations.sh ablations 6.4"
}

for table in "${tables[@]}"; do
  if [ "$table" = 5.3 ]; then table_5_3; else table_6_4; fi
done
