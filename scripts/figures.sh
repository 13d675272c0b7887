# shellcheck shell=bash disable=SC2154
# Functions of the scripts that write the tables of docs/results; source this file from the root of the repository.
# They need $folder, the folder of the runs. SEEDS="1 2 3" (the default) become the array `seeds`.
read -ra seeds <<<"${SEEDS:-1 2 3}"
doppel="${DOPPEL:-build/release/tools/doppel}"
[ -x "$doppel" ] || { scripts/install_dependencies.sh; cmake --preset release >/dev/null; cmake --build --preset release --target doppel; }

# provenance COMMAND: the lines below a table that say how it was made
provenance() {
  echo
  echo "\`$1\`, commit $(git rev-parse --short HEAD)$(git diff --quiet HEAD || echo ' with changes'), $(nproc --all) cores of $(grep -m1 'model name' /proc/cpuinfo | sed 's/.*: //'), $(date -u +%F)"
}

# figure FILE METHOD METRIC DIGITS: a metric of a method in the JSON of `doppel evaluate`, over the evaluated cameras
figure() {
  sed 's/"cameras":{[^}]*},*//g' "$folder/$1" | grep -o "\"$2\":{[^{}]*" | head -1 | grep -o "\"$3\":[0-9.e-]*" | head -1 |
    cut -d: -f2 | xargs -r printf "%.$4f"
}

# spread DIGITS: mean and largest distance from the mean of the numbers on standard input, one a line; one number alone
# is printed as such
spread() {
  awk -v digits="$1" '
    NF == 0 { missing = 1 }
    { x[NR] = $1; sum += $1 }
    END {
      if (missing || NR == 0) { printf "missing"; exit }
      mean = sum / NR
      if (NR == 1) { printf "%.*f", digits, mean; exit }
      for (i in x) { e = x[i] - mean; if (e < 0) e = -e; if (e > widest) widest = e }
      printf "%.*f ± %.*f", digits, mean, digits, widest
    }'
}

# over_seeds DIGITS COMMAND [argument ...]: mean and spread of what a command prints; its last argument is the seed
over_seeds() {
  local seed
  for seed in "${seeds[@]}"; do "${@:2}" "$seed"; echo; done | spread "$1"
}

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
