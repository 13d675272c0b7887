#!/usr/bin/env bash
# Compares the results of two builds, byte by byte: a change that should change nothing has changed nothing.
#   scripts/same_results.sh PROGRAM PROGRAM [FOLDER]
# Each program makes the tiny synthetic capture, tracks it by multi-view fit and livecap, trains the tiny chains (ddc,
# hybrid, deepcap) and 100 steps of the quickstart, evaluates, exports and animates, with the configurations of its own
# checkout. Compared are motions, vertices, prepared captures, the tensors of checkpoints, and all JSON but times. Prints
# the number of equal files of each kind and the names of the others; exits 1 if there are any. Takes three minutes a
# program on two cores.
set -euo pipefail
[ $# -ge 2 ] || { sed -n '2,8s/^# //p' "$0" >&2; exit 2; }
work="${3:-$(mktemp -d)}"
mkdir -p "$work"
export OMP_NUM_THREADS=2

# results PROGRAM NAME: everything into $work/NAME. Both programs work in $work/results, because runs name their folder.
results() {
  local program run
  program="$(realpath "$1")"
  rm -rf "$work/results" "${work:?}/$2"
  mkdir "$work/results"
  cd "$work/results"
  cp -r "$(dirname "$program")/../../../configs" configs
  "$program" synth --preset tiny --out capture
  "$program" track capture --out multiview
  "$program" track livecap capture --camera 0 --sequences testing --vertices --out livecap
  # One thread: several write the records of the store in the order in which they finish.
  "$program" prepare capture --threads 1 --out prepared
  "$program" train configs/quickstart/egnet.yaml --set capture=prepared --set train.iterations=100 --out quickstart
  "$program" train configs/tiny/ddc.yaml --set capture=prepared --out ddc
  "$program" train configs/tiny/hybrid.yaml --set capture=prepared --set ddc=ddc --out hybrid
  "$program" train configs/tiny/deepcap.yaml --set capture=prepared --out deepcap
  for run in quickstart ddc hybrid deepcap; do
    "$program" evaluate --run $run --split test --json >$run.evaluation.json
  done
  "$program" export --run ddc --out actor.pt
  "$program" animate --character capture/character/actor.character --model actor.pt \
    --motion capture/testing/skeletoolToGTPose/poseAngles.motion --format npy --out animation
  mv "$work/results" "$work/$2"
}

(results "$1" first) >"$work/first.log" 2>&1 || { tail "$work/first.log" >&2; exit 1; }
(results "$2" second) >"$work/second.log" 2>&1 || { tail "$work/second.log" >&2; exit 1; }

python3 - "$work/first" "$work/second" <<'PYTHON'
import collections, json, os, sys, zipfile

def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(item) for key, item in value.items() if 'second' not in key}
    return [without_times(item) for item in value] if isinstance(value, list) else value

def content(path):
    """What must be equal in a file: its tensors, its JSON without times, or its bytes."""
    if path.endswith('.pt'):
        with zipfile.ZipFile(path) as archive:
            return b''.join(archive.read(name) for name in sorted(archive.namelist()) if '/data/' in name)
    with open(path, 'rb') as file:
        data = file.read()
    return without_times(json.loads(data)) if path.endswith('.json') else data

kinds = ('.npy', '.motion', '.pt', '.json', '.mdb', '.character', '.skeleton', '.skin', '.obj')
first, second = sys.argv[1:]
equal, different = collections.Counter(), []
for folder, _, names in os.walk(first):
    for name in names:
        kind = os.path.splitext(name)[1]
        if kind not in kinds or name == 'lock.mdb':
            continue
        path = os.path.relpath(os.path.join(folder, name), first)
        other = os.path.join(second, path)
        if os.path.exists(other) and content(os.path.join(first, path)) == content(other):
            equal[kind] += 1
        else:
            different.append(path)
for kind, count in sorted(equal.items()):
    print(f'{count:4d} equal {kind}')
for path in sorted(different):
    print('differs:', path)
sys.exit(1 if different or not equal else 0)
PYTHON
