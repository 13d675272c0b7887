# shellcheck shell=bash disable=SC2154
# Functions of the scripts that write the tables of docs/results; source this file from the root of the repository.
# They need $folder, the folder of the runs. SEEDS="1 2 3" (the default) become the array `seeds`.
read -ra seeds <<<"${SEEDS:-1 2 3}"
doppel="${DOPPEL:-build/release/tools/doppel}"
[ -x "$doppel" ] || { scripts/install_dependencies.sh; cmake --preset release >/dev/null; cmake --build --preset release --target doppel; }

# write_table NAME COMMAND: fills figures into the table on standard input (scripts/tables.py), adds how it was made, prints
# it and writes it to NAME.md
write_table() {
  { scripts/tables.py "$folder" "${seeds[@]}" &&
    printf '\n`%s`, %s cores of %s\n' "$2" "$(nproc --all)" "$(grep -m1 'model name' /proc/cpuinfo | sed 's/.*: //')"; } |
    tee "$folder/$1.md"
}
# figure FILE KEY ... DIGITS: one figure, by the rules of scripts/tables.py
figure() { echo "{$*}" | scripts/tables.py "$folder" "${seeds[@]}"; }

# train RUN CONFIG [option ...]: trains a run, or what is missing of it. Its messages go to RUN.log.
train() {
  "$doppel" train "$2" "${@:3}" --out "$folder/$1" >/dev/null 2>>"$folder/$1.log" ||
    { echo "training of $folder/$1 failed:" && tail -3 "$folder/$1.log"; return 1; } >&2
}
# evaluate RUN FILE [option ...]: evaluates a run once and writes FILE.json
evaluate() {
  [ -f "$folder/$2.json" ] && return
  "$doppel" evaluate --run "$folder/$1" "${@:3}" --json >"$folder/$2.json.part" 2>>"$folder/$1.log" ||
    { echo "evaluation of $folder/$1 failed:" && tail -3 "$folder/$1.log"; return 1; } >&2
  mv "$folder/$2.json.part" "$folder/$2.json"
}
# once FILE COMMAND ...: runs a command of doppel that writes FILE, unless FILE is there; messages go to steps.log
once() {
  [ -e "$folder/$1" ] && return
  echo "doppel ${*:2:2} ... ($1)" >&2
  "$doppel" "${@:2}" >/dev/null 2>>"$folder/steps.log" ||
    { echo "$* failed:" && tail -3 "$folder/steps.log"; return 1; } >&2
}
# follow PART OPTION ...: from the recording's capture in `detected`, with options of `capture amend`: body, poses and their
# refinement in the folder PART, without the last quarter of the frames
follow() {
  local out="$folder/$1"
  mkdir -p "$out"
  once "$1/split.yaml" capture amend "$folder/detected" "${@:2}" --hold-out --validation-share 0 --test-share 0.25 \
    --out "$out/split.yaml"
  once "$1/fit/capture.yaml" character fit "$out/split.yaml" --out "$out/fit"
  once "$1/tracked/capture.yaml" track "$out/fit/capture.yaml" --config "$out/fit/track.yaml" --out "$out/tracked"
  once "$1/refined/capture.yaml" track refine "$out/tracked" --config "$out/fit/track.yaml" --out "$out/refined"
}
# as_options KEY=VALUE ...: fills the array `options` with --set KEY=VALUE ...
as_options() {
  local change
  options=()
  for change in "$@"; do options+=(--set "$change"); done
}

# steps N: the share $SHARE (default 1) of N steps
steps() { awk -v n="$1" -v share="${SHARE:-1}" 'BEGIN { printf "%d", n * share }'; }
# side_by_side COMMAND ...: starts a command that runs beside others, at most $JOBS (default 2) at a time. Training and
# evaluation use one thread each in these scripts, so that results do not depend on the number of cores.
side_by_side() {
  while [ "$(jobs -rp | wc -l)" -ge "${JOBS:-2}" ]; do sleep 1; done
  { "$@" || touch "$folder/failed"; } &
}
# all_done: waits for these commands; fails if one has failed
all_done() {
  wait
  [ ! -e "$folder/failed" ] || { rm "$folder/failed"; return 1; }
}
trap 'kill $(jobs -rp) 2>/dev/null || true' EXIT
export OMP_NUM_THREADS=1
