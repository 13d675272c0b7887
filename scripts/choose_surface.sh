#!/usr/bin/env bash
# Chooses `inset` and `chroma`, without anchors, on training frames: trains on one take of the training sequence
# and judges on the other, in both directions. The test split is not read.
#   scripts/choose_surface.sh CAPTURE [FOLDER]     default: the folder choose-surface; resumes after an interruption
# CAMERAS=0,1,2,3,4,5 (the default) are trained on. JOBS=2 (the default) runs are trained side by side, with one thread
# each. One seed.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
capture="$1" folder="${2:-choose-surface}" cameras="${CAMERAS:-0,1,2,3,4,5}"
source scripts/figures.sh
mkdir -p "$folder"
"$doppel" prepare "$capture" --mask-size 700 --out "$folder/prepared" >/dev/null
chromas=(0.03775 20) insets=(-0.2 -0.4)

# stages NAME TAKE STAGES [key=value ...]: trains with a take held out, and evaluates on it
stages() {
  local run="$1-$2" stage sets=() options
  for stage in ${3//,/ }; do sets+=("$stage.data.cameras=[$cameras]"); done
  sets+=(egnet.loss.anchor=0 deltanet.loss.anchor=0)
  as_options capture="$folder/prepared" validation.takes="[$2]" "${sets[@]}" "${@:4}"
  train "$run" configs/small/ddc.yaml "${options[@]}" --stages "$3"
  evaluate "$run" "$run" --split validation --every 4
}

# candidate INSET CHROMA TAKE
candidate() {
  local base
  base="{run: $(realpath "$folder")/base-$3}"
  stages "inset$1-chroma$2" "$3" deltanet egnet="$base" lighting="$base" deltanet.loss.inset="$1" deltanet.loss.chroma="$2"
}

for take in 0 1; do side_by_side stages base $take egnet,lighting egnet.train.iterations=2000; done
all_done

# The chroma weight without inset, then the inset with the better weight.
for chroma in "${chromas[@]}"; do
  for take in 0 1; do side_by_side candidate 0 "$chroma" $take; done
done
all_done
best=$(for chroma in "${chromas[@]}"; do echo "$(figure "inset0-chroma$chroma-[0,1].json" lit MSE 6) $chroma"; done | sort -n | head -1 | cut -d' ' -f2)
for inset in "${insets[@]}"; do
  for take in 0 1; do side_by_side candidate "$inset" "$best" $take; done
done
all_done

# row INSET CHROMA: the means over the two takes
row() { echo "| $1 | $2 | {inset$1-chroma$2-[0,1].json deltanet AMVIoU 4} | {inset$1-chroma$2-[0,1].json lit MSE 1} |"; }
{
  echo "| \`inset\` | \`chroma\` | AMVIoU | masked MSE, static texture under learnt lighting |"
  echo "|---:|---:|---:|---:|"
  for chroma in "${chromas[@]}"; do row 0 "$chroma"; done
  for inset in "${insets[@]}"; do row "$inset" "$best"; done
} | write_table surface "scripts/choose_surface.sh CAPTURE"
