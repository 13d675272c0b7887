#!/usr/bin/env bash
# Checks files of `doppel animate --format npy,glb,fbx,pc2`: no error or warning of Khronos's glTF validator in a .glb,
# and three.js in a browser moves the vertices as vertices.npy says; with camera.json beside the file, it draws the same
# images (tests/web/check_glb.mjs).
#   scripts/check_glb.sh FILE ...          exit code 77: node, npm or chromium is missing, or npm reaches no registry
set -euo pipefail
[ $# -ge 1 ] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
files=()
for file in "$@"; do files+=("$(realpath "$file")"); done
cd "$(dirname "$0")/../tests/web"
command -v chromium >/dev/null || { echo "check_glb.sh: chromium is not installed; skipped" >&2; exit 77; }
./modules.sh
CHROMIUM="$(command -v chromium)" exec node check_glb.mjs "${files[@]}"
