#!/usr/bin/env bash
# Compares the results of two builds, byte by byte: a change that should change nothing has changed nothing.
#   scripts/same_results.sh PROGRAM PROGRAM [FOLDER]
# Each program makes the tiny synthetic capture, tracks it by all methods, trains the tiny chains (ddc, deepcap, hybrid) and
# the first 100 steps of the quickstart, evaluates, exports and animates, with the configurations beside it in its checkout.
# Compared are motions, vertices, checkpoints (numbers only: a checkpoint also names its folder), evaluations and prepared
# captures. Prints one line a file kind and exits 1 at a difference. Takes five minutes a program on two cores.
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,8s/^# //p' "$0" >&2; exit 2; }
work="${3:-$(mktemp -d)}"
mkdir -p "$work"
export OMP_NUM_THREADS=2

# results PROGRAM FOLDER: everything into FOLDER, with the same relative paths for both programs.
results() {
  local program configs
  program="$(realpath "$1")"
  configs="$(realpath "$(dirname "$program")/../../../configs")"
  mkdir -p "$2"
  cd "$2"
  cp -r "$configs" configs
  local track=(track capture)
  "$program" synth --preset tiny --out capture
  "$program" "${track[@]}" --out multiview
  if "$program" track --help | grep -q -- --method; then
    "$program" track capture --method livecap --camera 0 --sequences testing --vertices --out livecap
  else
    "$program" track livecap capture --camera 0 --sequences testing --vertices --out livecap
  fi
  "$program" prepare capture --out prepared
  "$program" train configs/quickstart/egnet.yaml --set capture=prepared --set train.iterations=100 --out quickstart
  "$program" train configs/tiny/ddc.yaml --set capture=prepared --out ddc
  "$program" train configs/tiny/hybrid.yaml --set capture=prepared --set ddc=ddc --out hybrid
  if [ -f configs/tiny/deepcap.yaml ]; then
    "$program" train configs/tiny/deepcap.yaml --set capture=prepared --out deepcap
  else
    "$program" train configs/tiny/posenet.yaml --set capture=prepared --out posenet
    "$program" train configs/tiny/defnet.yaml --set capture=prepared --set posenet.run=posenet --out deepcap
  fi
  for run in quickstart ddc hybrid deepcap; do
    "$program" evaluate --run $run --split test --json >$run.evaluation.json
  done
  "$program" export --run ddc --out actor.pt
  "$program" animate --character capture/character/actor.character --model actor.pt \
    --motion capture/testing/skeletoolToGTPose/poseAngles.motion --format npy --out animation
}

(results "$1" "$work/first") >"$work/first.log" 2>&1 || { tail "$work/first.log" >&2; exit 1; }
(results "$2" "$work/second") >"$work/second.log" 2>&1 || { tail "$work/second.log" >&2; exit 1; }

python3 - "$work/first" "$work/second" <<'PYTHON'
import collections, json, os, re, sys, zipfile

def numbers(path):
    """What must be equal in a file: its bytes, its tensors, or its JSON without times, paths and rates."""
    if path.endswith('.pt'):
        with zipfile.ZipFile(path) as archive:
            return b''.join(archive.read(name) for name in sorted(archive.namelist()) if '/data/' in name)
    with open(path, 'rb') as file:
        data = file.read()
    if path.endswith('.json'):
        def clean(value):
            if isinstance(value, dict):
                return {k: clean(v) for k, v in value.items() if not re.search('second|minute|time|rate|path|memory', k)}
            return [clean(v) for v in value] if isinstance(value, list) else value
        return json.dumps(clean(json.loads(data))).encode()
    return data

kinds = ('.npy', '.motion', '.pt', '.json', '.mdb', '.character', '.skeleton', '.skin', '.obj')
first, second = sys.argv[1:]
equal, different = collections.Counter(), []
for folder, _, names in os.walk(first):
    for name in names:
        kind = os.path.splitext(name)[1]
        if kind not in kinds:
            continue
        path = os.path.relpath(os.path.join(folder, name), first)
        other = os.path.join(second, path)
        if os.path.exists(other) and numbers(os.path.join(first, path)) == numbers(other):
            equal[kind] += 1
        else:
            different.append(path)
for kind, count in sorted(equal.items()):
    print(f'{count:4d} equal {kind}')
for path in sorted(different):
    print('differs:', path)
sys.exit(1 if different or not equal else 0)
PYTHON
