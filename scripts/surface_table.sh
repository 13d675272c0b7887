#!/usr/bin/env bash
# Table 6.2: AMVIoU of skinning, of the multi-view fit to the test images, and of a trained chain `ddc`.
#   scripts/surface_table.sh CAPTURE RUN SEQUENCE [FOLDER]
# SEQUENCE is the test sequence. EVERY=100 is the step between compared frames (as in the thesis).
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 3 ] || { sed -n '2,4s/^# //p' "$0" >&2; exit 2; }
capture="$1" run="$2" sequence="$3" folder="${4:-surface-table}" every="${EVERY:-100}"
source scripts/figures.sh
mkdir -p "$folder"
"$doppel" prepare "$capture" --out "$folder/prepared" >/dev/null
[ -f "$folder/multiview/track.json" ] || "$doppel" track "$capture" --method multiview --surface --vertices \
  --sequences "$sequence" --sheet-frames 0 --out "$folder/multiview" >/dev/null
"$doppel" evaluate --tracked "$folder/multiview" --capture "$folder/prepared" --every "$every" --json >"$folder/fit.json"
for split in test train; do
  "$doppel" evaluate --run "$run" --split $split --every "$every" --json >"$folder/$split.json"
done
{
  echo "| Table 6.2 | AMVIoU |"
  echo "|---|---:|"
  echo "| multi-view fit | $(figure fit.json surface AMVIoU 4) |"
  echo "| skinning | $(figure test.json skinning AMVIoU 4) |"
  echo "| ours | $(figure test.json deltanet AMVIoU 4) |"
  echo "| ours, training frames | $(figure train.json deltanet AMVIoU 4) |"
  provenance "scripts/surface_table.sh CAPTURE RUN SEQUENCE"
} | tee "$folder/table-6.2.md"
