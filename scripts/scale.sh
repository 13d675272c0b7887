#!/usr/bin/env bash
# Cost by the number of frames (docs/results/scale.md): four cameras of doppel synth --preset studio, of which 250, 1,000 and
# all 3,000 training frames are used, and all of them seven times over. Times preparation, training of EGNet and evaluation.
#   scripts/scale.sh FOLDER      SIZES="250 1000 3000 21000" (the default); multiples of 3,000 repeat the frames
# Leave the machine alone: 40 minutes on two cores, of which the capture takes 25. Resumes after an interruption.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
folder="$1" steps=300 cameras=4
read -ra sizes <<<"${SIZES:-250 1000 3000 21000}"
source scripts/figures.sh
mkdir -p "$folder"
[ -d "$folder/studio" ] || "$doppel" synth --preset studio --out "$folder/studio" >/dev/null

# timed COMMAND ...: runs a command of doppel and prints its seconds; its messages go to steps.log
timed() {
  local begin
  begin=$(date +%s.%N)
  "$doppel" "$@" >>"$folder/steps.log" 2>&1 || { echo "$* failed:" && tail -3 "$folder/steps.log"; return 1; } >&2
  echo "$(date +%s.%N) $begin" | awk '{ printf "%.2f", $1 - $2 }'
}
# described N: the description of the capture with four cameras and its training sequence N times
described() {
  awk -v times="$1" '
    /^sequences:/ { print "cameras: [0, 1, 2, 3]" }
    /^  - name: training/ { inside = 1 }
    /^  - name: testing/ { for (i = 2; i <= times; ++i) { text = block; sub(/training/, "training" i, text); printf "%s", text }
                           inside = 0 }
    inside { block = block $0 "\n" }
    { print }' "$folder/studio/capture.yaml" >"$folder/studio/times$1.yaml"
  echo "$folder/studio/times$1.yaml"
}
# bytes_of PATH ...: of all files
bytes_of() { du -cb "$@" | awk 'END { print $1 }'; }
# metric STEP KEY: a number of the record of a step of training, without the parts below it
metric() { awk -v step="\"step\":$2," -v key="\"$3\":" 'index($0, step) { sub(".*" key, ""); sub("[,}].*", ""); print; exit }' "$1"; }

# measure FRAMES
measure() {
  local frames="$1" prepared="$folder/$1/prepared" run="$folder/$1/run" source begin
  [ -f "$folder/$frames.json" ] && return
  rm -rf "${folder:?}/$frames"
  source=$(described $((frames > 3000 ? frames / 3000 : 1)))
  local prepare train evaluate images evaluated
  prepare=$(timed prepare "$source" --limit-frames "$frames" --image-size 384 --out "$prepared")
  images=$(((frames + (frames < 500 ? frames : 500)) * cameras))
  train=$(timed train configs/small/ddc.yaml --stages egnet --set capture="$prepared" --set egnet.train.iterations=$steps \
    --set egnet.train.checkpoint_every=$steps --out "$run")
  evaluate=$(timed evaluate --run "$run" --split train --every $((frames / 50)))
  evaluated=$(($(grep -o '"train": *[0-9]*' "$run/evaluation.json" | grep -o '[0-9]*$' | head -1) * cameras))
  local records="$run/egnet/metrics.jsonl"
  begin=$(metric "$records" 100 seconds)
  awk -v prepare="$prepare" -v images="$images" -v bytes="$(bytes_of "$prepared/store")" -v train="$train" \
    -v first="$begin" -v last="$(metric "$records" $steps seconds)" -v steps=$steps \
    -v memory="$(metric "$records" $steps memory_mb)" -v checkpoint="$(bytes_of "$(find "$run" -name 'step-*.pt' | head -1)")" \
    -v evaluate="$evaluate" -v evaluated="$evaluated" 'BEGIN {
      printf "{\"prepare\": %f, \"stored\": %f, \"start\": %f, \"step\": %f, \"memory\": %f, \"checkpoint\": %f, \"evaluate\": %f}\n",
        1e3 * prepare / images, bytes / images / 1024, train - last, 1e3 * (last - first) / (steps - 100), memory,
        checkpoint / 1048576, 1e3 * evaluate / evaluated }' >"$folder/$frames.json.part"
  mv "$folder/$frames.json.part" "$folder/$frames.json"
}
for frames in "${sizes[@]}"; do measure "$frames"; done

# row TITLE KEY DIGITS
row() {
  printf '| %s |' "$1"
  for frames in "${sizes[@]}"; do printf ' {%s.json %s %s} |' "$frames" "$2" "$3"; done
  echo
}
{
  printf '| training frames of %s cameras |' "$cameras"
  printf ' %s |' "${sizes[@]}"
  printf '\n|---|'
  printf -- '---:|%.0s' "${sizes[@]}"
  echo
  row "\`prepare\`, ms an image" prepare 1
  row "store, KB an image" stored 1
  row "start and end of \`train\`, s" start 1
  row "EGNet, ms a step" step 1
  row "memory of \`train\`, MB" memory 0
  row "a checkpoint, MB" checkpoint 1
  row "\`evaluate\`, ms an image" evaluate 1
} | write_table scale "scripts/scale.sh FOLDER"
