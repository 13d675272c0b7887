#!/usr/bin/env bash
# Checks .glb files of `doppel animate --format npy,glb`: no error or warning of Khronos's glTF validator, and three.js in
# a browser moves the vertices as vertices.npy says.
#   scripts/check_glb.sh FILE.glb ...      exit code 77: node, npm or chromium is missing, or npm reaches no registry
set -euo pipefail
[ $# -ge 1 ] || { sed -n '2,4s/^# //p' "$0" >&2; exit 2; }
files=()
for file in "$@"; do files+=("$(realpath "$file")"); done
cd "$(dirname "$0")/../tests/web"
for program in node npm chromium; do
  command -v "$program" >/dev/null || { echo "check_glb.sh: $program is not installed; skipped" >&2; exit 77; }
done
if [ ! -d node_modules/three ]; then
  npm ci --no-audit --no-fund --loglevel=error >&2 || { echo "check_glb.sh: npm ci failed; skipped" >&2; exit 77; }
fi
CHROMIUM="$(command -v chromium)" exec node check_glb.mjs "${files[@]}"
