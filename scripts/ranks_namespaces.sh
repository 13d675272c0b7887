#!/usr/bin/env bash
# Trains with one, two and four ranks, each in a network namespace of its own, behind a wire of 1 Gbit/s and 1 ms where
# the machine lets tc set that. Compares the losses of all steps, prints the times, then cuts a cable. Run it as root:
#   scripts/ranks_namespaces.sh [--ranks 1,2,4] [--no-cable] [CONFIG] [CAPTURE] [STAGE]
# CONFIG: a configuration; default configs/tiny/ddc.yaml. CAPTURE: a prepared capture; default: that of
# `doppel synth --preset tiny`. STAGE: a stage of the configuration; default egnet. DOPPEL names the program (default
# build/release/tools/doppel), STEPS the number of steps (default 50), SET more options of doppel train.
set -euo pipefail
cd "$(dirname "$0")/.."
worlds=(1 2 4)
cable=yes
while [[ "${1:-}" == --* ]]; do
  case "$1" in
    --ranks) IFS=, read -ra worlds <<< "$2"; shift 2 ;;
    --no-cable) cable=no; shift ;;
    *) echo "ranks_namespaces.sh: unknown option $1 (allowed: --ranks, --no-cable)" >&2; exit 2 ;;
  esac
done
config=${1:-configs/tiny/ddc.yaml} capture=${2:-} stage=${3:-egnet}
doppel=$(realpath "${DOPPEL:-build/release/tools/doppel}")
steps=${STEPS:-50}
[ "$(id -u)" -eq 0 ] || { echo "ranks_namespaces.sh: network namespaces need root" >&2; exit 2; }
command -v ip >/dev/null || { echo "ranks_namespaces.sh: needs ip (package iproute2)" >&2; exit 2; }

work=$(mktemp -d)
bridge=dplbr$$
namespaces=()
cleanup() {
  for name in "${namespaces[@]}"; do ip netns del "$name" 2>/dev/null || true; done
  ip link del "$bridge" 2>/dev/null || true
  rm -rf "$work"
}
trap cleanup EXIT

ip link add "$bridge" type bridge
ip link set "$bridge" up
shaped=yes
for ((r = 0; r < 4; r++)); do
  name=doppel-$$-$r
  ip netns add "$name"
  namespaces+=("$name")
  ip link add "dv$$a$r" type veth peer name "dv$$b$r"
  ip link set "dv$$a$r" master "$bridge" up
  ip link set "dv$$b$r" netns "$name" name eth0
  ip -n "$name" link set lo up
  ip -n "$name" link set eth0 up
  ip -n "$name" addr add "10.77.0.$((r + 1))/24" dev eth0
  # 1 ms on the way out of each machine.
  if ip netns exec "$name" tc qdisc add dev eth0 root netem delay 1ms rate 1gbit 2>/dev/null; then :
  elif ip netns exec "$name" tc qdisc add dev eth0 root tbf rate 1gbit burst 256kb latency 50ms 2>/dev/null; then shaped="1 Gbit/s without delay (no netem)"
  else shaped=no; fi
done
case $shaped in
  yes) echo "wire: 1 Gbit/s, 1 ms each way (netem)" ;;
  no) echo "wire: SKIPPED, this machine has neither netem nor tbf; the namespaces are connected at memory speed" ;;
  *) echo "wire: $shaped" ;;
esac

if [ -z "$capture" ]; then
  "$doppel" synth --preset tiny --out "$work/capture" --log-level warn >/dev/null
  "$doppel" prepare "$work/capture" --out "$work/prepared" --log-level warn >/dev/null
  capture=$work/prepared
fi

# rank R of N into run OUT, in its namespace
start_rank() {
  ip netns exec "doppel-$$-$1" env RANK="$1" WORLD_SIZE="$2" MASTER_ADDR=10.77.0.1 MASTER_PORT=29555 OMP_NUM_THREADS=1 \
    "$doppel" train "$config" --set capture="$(realpath "$capture")" --stages "$stage" --out "$3" --log-level warn \
    --set "$stage.train.log_every=1" --set "$stage.train.iterations=$4" ${SET:-} >"$work/log-$2-$1" 2>&1
}
ranks() {
  local pids=() failed=0
  for ((r = 0; r < $1; r++)); do start_rank "$r" "$1" "$2" "$3" & pids+=($!); done
  for pid in "${pids[@]}"; do wait "$pid" || failed=1; done
  [ $failed = 0 ] || { cat "$work"/log-"$1"-* >&2; exit 1; }
}

for world in "${worlds[@]}"; do ranks "$world" "$work/run-$world" "$steps"; done
python3 - "$work" "$stage" "${worlds[@]}" <<'PY'
import json, sys
work, stage, worlds = sys.argv[1], sys.argv[2], [int(w) for w in sys.argv[3:]]
runs = {w: [json.loads(l) for l in open(f"{work}/run-{w}/{stage}/metrics.jsonl")] for w in worlds}
def pace(run):
    late = run[len(run) // 5:]
    return 1000 * (late[-1]["seconds"] - late[0]["seconds"]) / (len(late) - 1)
worst = 0.0
for w in worlds:
    gap = max(abs(a["loss"] - b["loss"]) / max(1, abs(a["loss"])) for a, b in zip(runs[worlds[0]], runs[w]))
    worst = max(worst, gap)
    print(f"{w} ranks: {len(runs[w])} steps, {pace(runs[w]):.1f} ms a step, {pace(runs[worlds[0]]) / pace(runs[w]):.2f} x "
          f"the samples a second of {worlds[0]}, largest difference of the loss {gap:.1e}")
if worst > 1e-5:
    sys.exit(f"the losses differ by {worst:.1e}; at most 1e-5 is allowed")
PY

[ $cable = yes ] || exit 0
echo "cutting the cable of rank 1 ..."
start_rank 0 2 "$work/cut" 1000000 & zero=$!
start_rank 1 2 "$work/cut" 1000000 & one=$!
until [ -s "$work/cut/$stage/metrics.jsonl" ]; do sleep 0.2; done
ip -n "doppel-$$-1" link set eth0 down
begin=$(date +%s)
code=0
wait "$zero" || code=$?
echo "rank 0 ended after $(($(date +%s) - begin)) s with status $code: $(tail -1 "$work/log-2-0")"
wait "$one" && exit 1
echo "rank 1 ended after $(($(date +%s) - begin)) s: $(tail -1 "$work/log-2-1")"
[ "$code" -eq 1 ] && grep -q "rank 1" "$work/log-2-0"
