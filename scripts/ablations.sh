#!/usr/bin/env bash
# Trains the variants of the thesis's ablations on the synthetic person and writes their tables to FOLDER/tables_*.md.
#   scripts/ablations.sh [FOLDER] [TABLE ...]      default: ablations, both tables; resumes after an interruption
#     5.3   DeepCap with fewer cameras, with fewer frames, without DefNet     about half an hour on one thread
#     6.4   Tables 6.4 and 6.5 (6.9.5): parts of the actor, its cameras       about half an hour
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

# train CONFIG RUN STAGES [key=value ...]
train() {
  local config=$1 run=$2 stages=$3 sets=() change
  shift 3
  for change in "$@"; do sets+=(--set "$change"); done
  "$doppel" train "configs/ablation/$config.yaml" --set capture="$folder/prepared" "${sets[@]}" --stages "$stages" --out "$folder/$run"
}

amviou() { figure "$1.all.json" "$2" AMVIoU 4; }

# ---- Table 5.3 ----

# deepcap NAME [key=value ...]: trains a variant; the keys belong to `data` of both networks. The test motion is
# captured from each camera in turn. Camera 0 is among the training cameras of all variants.
deepcap() {
  local name=$1 sets=() change camera
  shift
  for change in "$@"; do sets+=("posenet.data.$change" "defnet.data.$change"); done
  train deepcap "deepcap-$name" posenet,defnet "${sets[@]}"
  for camera in 0 1 2 3 4 5 6 7; do
    "$doppel" evaluate --run "$folder/deepcap-$name" --split test --every 2 --input-camera $camera --json >"$folder/deepcap-$name.$camera.json"
  done
}

# mean NAME METHOD METRIC DIGITS: mean over the cameras from which a run captures
mean() { for camera in 0 1 2 3 4 5 6 7; do figure "deepcap-$1.$camera.json" "$2" "$3" 6; echo; done | awk -v d="$4" '{ s += $1 } END { printf "%.*f", d, s / NR }'; }
# line TITLE NAME METHOD: a row of Table 5.3
line() {
  echo "| $1 | $(figure "deepcap-$2.0.json" "$3" 3DPCK 1) | $(figure "deepcap-$2.0.json" "$3" AMVIoU 4) | $(mean "$2" "$3" 3DPCK 1) | $(mean "$2" "$3" AMVIoU 4) |"
}

table_5_3() {
  deepcap ours
  deepcap cameras-1 "cameras=[0]"
  deepcap cameras-2 "cameras=[0,2]"
  deepcap cameras-3 "cameras=[0,2,5]"
  deepcap quarter "frames=[$(seq -s, 0 4 119)]"
  deepcap half "frames=[$(seq -s, 0 2 119)]"
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
  } | tee "$folder/tables_5.3.md"
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

# ddc NAME CAMERAS STAGES [key=value ...]: trains STAGES; earlier stages come from the variant `ours`
ddc() {
  local name=$1 chosen=$2 stages=$3 sets=() stage
  shift 3
  for stage in egnet lighting deltanet texnet; do
    if [[ ",$stages," == *",$stage,"* ]]; then
      sets+=("$stage.data.cameras=$chosen")
    elif [ "$stage" = egnet ] || [ "$stage" = lighting ]; then
      sets+=("$stage={run: $(realpath "$folder")/ours}")
    fi
  done
  train ddc "$name" "$stages" "${sets[@]}" "$@"
  # Geometry is evaluated in all cameras, as AMVIoU requires; images in the held-out camera.
  "$doppel" evaluate --run "$folder/$name" --split test --every 4 --json >"$folder/$name.all.json"
  "$doppel" evaluate --run "$folder/$name" --split test --cameras $held_out --json >"$folder/$name.held.json"
}

mse() { figure "$1.held.json" "$2" MSE 2; }

table_6_4() {
  local all n run
  all=$(cameras $held_out)
  ddc ours "$all" egnet,lighting,deltanet,texnet
  ddc fully-connected "$all" egnet,lighting,deltanet egnet.model.network=fully_connected deltanet.model.network=fully_connected
  ddc unstructured "$all" egnet,lighting,deltanet egnet.model.network=chebyshev deltanet.model.network=chebyshev
  ddc global "$all" deltanet deltanet.model.space=global
  ddc no-chroma "$all" deltanet deltanet.loss.chroma=0
  for n in "${cameras_6_5[@]}"; do
    [ "$n" = $held_out ] || ddc "cameras-$n" "$(cameras "$n")" egnet,lighting,deltanet,texnet
  done
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
  } | tee "$folder/tables_6.4.md"
}

for table in "${tables[@]}"; do
  if [ "$table" = 5.3 ]; then table_5_3; else table_6_4; fi
done
