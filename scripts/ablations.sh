#!/usr/bin/env bash
# Trains the variants of Tables 6.4 and 6.5 (thesis 6.9.5) on the synthetic actor and writes their tables.
#   scripts/ablations.sh [FOLDER]     default: ablations; about half an hour, resumed where it stopped
# One camera, 007, is never trained on: pictures are compared in it alone.
set -euo pipefail
cd "$(dirname "$0")/.."
folder="${1:-ablations}"
doppel="${DOPPEL:-build/release/tools/doppel}"
[ -x "$doppel" ] || { scripts/install_dependencies.sh; cmake --preset release >/dev/null; cmake --build --preset release --target doppel; }

held_out=7
cameras_6_5=(2 4 7)

[ -f "$folder/capture/capture.yaml" ] || "$doppel" synth --preset small --out "$folder/capture"
"$doppel" prepare "$folder/capture" --out "$folder/prepared" >/dev/null

# names of N cameras spread over the ring, without the one that is held out
cameras() {
  local n=$1 i list=()
  for ((i = 0; i < n; ++i)); do list+=($((i * held_out / n))); done
  (IFS=,; echo "[${list[*]}]")
}

# variant NAME CAMERAS STAGES [key=value ...]: trains STAGES, takes those before them from the variant `ours`
variant() {
  local name=$1 chosen=$2 stages=$3 sets=() stage change
  shift 3
  for stage in egnet lighting deltanet texnet; do
    if [[ ",$stages," == *",$stage,"* ]]; then
      sets+=(--set "$stage.data.cameras=$chosen")
    elif [ "$stage" = egnet ] || [ "$stage" = lighting ]; then
      sets+=(--set "$stage={run: $(realpath "$folder")/ours}")
    fi
  done
  for change in "$@"; do sets+=(--set "$change"); done
  "$doppel" train configs/ablation/ddc.yaml --set capture="$folder/prepared" "${sets[@]}" --stages "$stages" --out "$folder/$name"
  # Geometry in all cameras, as AMVIoU wants; pictures in the camera that nobody trained on.
  "$doppel" evaluate --run "$folder/$name" --split test --every 4 --json >"$folder/$name.all.json"
  "$doppel" evaluate --run "$folder/$name" --split test --cameras $held_out --json >"$folder/$name.held.json"
}

# figure FILE METHOD METRIC DIGITS
figure() { grep -o "\"$2\":{[^{]*" "$folder/$1" | head -1 | grep -o "\"$3\":[0-9.e-]*" | head -1 | cut -d: -f2 | xargs printf "%.$4f"; }
amviou() { figure "$1.all.json" "$2" AMVIoU 4; }
mse() { figure "$1.held.json" "$2" MSE 2; }

all=$(cameras $held_out)
variant ours "$all" egnet,lighting,deltanet,texnet
variant fully-connected "$all" egnet,lighting,deltanet egnet.model.network=fully_connected deltanet.model.network=fully_connected
variant unstructured "$all" egnet,lighting,deltanet egnet.model.network=chebyshev deltanet.model.network=chebyshev
variant global "$all" deltanet deltanet.model.space=global
variant no-chroma "$all" deltanet deltanet.loss.chroma=0
for n in "${cameras_6_5[@]}"; do
  [ "$n" = $held_out ] || variant "cameras-$n" "$(cameras "$n")" egnet,lighting,deltanet,texnet
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
} | tee "$folder/tables.md"
