#!/usr/bin/env bash
# The figures of docs/results/chapter6.md on the studio capture: configs/small/ddc.yaml with three seeds. Prints AMVIoU and
# image errors of the test movement, Table 6.2 and Table 6.3. The test split is evaluated here only, after all choices.
#   scripts/studio.sh CAPTURE SEQUENCE [FOLDER]     default: the folder studio; resumes after an interruption
# SEQUENCE is the name of the test sequence. SEEDS="1 2 3" and JOBS=2 (the defaults) as in scripts/extras.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 2 ] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
capture="$1" sequence="$2" folder="${3:-studio}"
trained=0,1,2,3,4,5 new=6,7
source scripts/figures.sh
mkdir -p "$folder"
"$doppel" prepare "$capture" --mask-size 700 --out "$folder/prepared" >/dev/null

# chain SEED: trains and evaluates
chain() {
  local run="ddc-$1" options
  as_options seed="$1" capture="$folder/prepared" {egnet,lighting,deltanet,texnet}.data.cameras="[$trained]"
  train "$run" configs/small/ddc.yaml "${options[@]}"
  as_options seed="$1" capture="$folder/prepared" ddc="$folder/$run" gaussians.data.cameras="[$trained]"
  train "$run-gaussians" configs/small/gaussians.yaml "${options[@]}"
  evaluate "$run" "$run.geometry" --split test --every 2
  evaluate "$run" "$run.train" --split train --every 4
  local split cameras
  for split in train test; do
    for cameras in $trained $new; do
      evaluate "$run-gaussians" "$run.$split.$cameras" --split $split --every 8 --cameras "$cameras"
    done
  done
}
for seed in "${seeds[@]}"; do side_by_side chain "$seed"; done
all_done

# The multi-view fit to the test images, first row of Table 6.2.
[ -f "$folder/fit/track.json" ] || "$doppel" track "$capture" --surface --vertices \
  --sequences "$sequence" --sheet-frames 0 --out "$folder/fit" >/dev/null
[ -f "$folder/fit.json" ] || "$doppel" evaluate --tracked "$folder/fit" --capture "$folder/prepared" --every 2 --json >"$folder/fit.json"

{
  echo "| Table 6.2 | AMVIoU |"
  echo "|---|---:|"
  echo "| multi-view fit | {fit.json surface AMVIoU 4} |"
  echo "| skinning | {ddc-@.geometry.json skinning AMVIoU 4} |"
  echo "| EGNet | {ddc-@.geometry.json egnet AMVIoU 4} |"
  echo "| DeltaNet | {ddc-@.geometry.json deltanet AMVIoU 4} |"
  echo "| DeltaNet, training frames | {ddc-@.train.json deltanet AMVIoU 4} |"
  echo
  echo "| test movement, cameras $trained | masked MSE |"
  echo "|---|---:|"
  for method in static lit texnet gaussians; do
    echo "| \`$method\` | {ddc-@.test.$trained.json $method MSE 1} |"
  done
  echo
  echo "| motion | cameras | | MSE | SSIM | MSE as filmed | SSIM as filmed | outline_MSE |"
  echo "|---|---|---|---:|---:|---:|---:|---:|"
  for split in train test; do
    for cameras in $trained $new; do
      file=ddc-@.$split.$cameras.json
      for method in texnet gaussians; do
        scores="{$file $method MSE 1} | {$file $method SSIM 4}"
        filmed="{$file $method filmed MSE 1} | {$file $method filmed SSIM 4} | {$file $method outline_MSE 1}"
        echo "| $split | $cameras | \`$method\` | $scores | $filmed |"
      done
    done
  done
} | write_table studio "scripts/studio.sh CAPTURE SEQUENCE"
