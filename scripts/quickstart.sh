#!/usr/bin/env bash
# From a fresh checkout to a trained actor: installs missing packages, builds, creates a synthetic capture of a person,
# prepares it, trains a model on its images, evaluates, exports, and renders a video. All results are written to ./demo
# (or the folder given as $1). A second run keeps the build and the capture, and trains again.
# DOPPEL names an installed program; then nothing is installed or built.
set -euo pipefail
cd "$(dirname "$0")/.."
demo="${1:-demo}"
export CMAKE_BUILD_PARALLEL_LEVEL="${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}"

step() { printf '\n== %s\n' "$*" >&2; }

doppel="${DOPPEL:-}"
if [ -z "$doppel" ]; then
  step "Packages"
  scripts/install_dependencies.sh

  step "Build"
  cmake --preset quickstart >/dev/null
  cmake --build --preset quickstart
  doppel=build/release/tools/doppel
fi

if [ ! -f "$demo/capture/capture.yaml" ]; then
  step "A synthetic capture of a person, filmed by eight cameras"
  "$doppel" synth --preset small --out "$demo/capture"
fi

step "Prepare the capture"
"$doppel" prepare "$demo/capture" --out "$demo/prepared"

step "Train EGNet"
"$doppel" train configs/quickstart/egnet.yaml --set capture="$demo/prepared" --out "$demo/run" --overwrite

step "Evaluate on motion it has never seen"
"$doppel" evaluate --run "$demo/run" --split test

step "Export and film"
"$doppel" export --run "$demo/run" --out "$demo/run/actor.pt"
"$doppel" animate --character "$demo/capture/character/actor.character" --model "$demo/run/actor.pt" \
  --motion "$demo/capture/testing/skeletoolToGTPose/poseAngles.motion" --format npy,mp4 --out "$demo/animation"

cat <<DONE

Done. Look at
  $demo/run/report.html              curves and overlays
  $demo/animation/turntable.mp4      the actor in the test motion
  $demo/run/actor.pt                 the model as one TorchScript file (examples/ shows how to load it)
DONE
