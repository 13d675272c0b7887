#!/usr/bin/env bash
# Installs the npm packages of these tests once. Exit code 77: node or npm is missing, or npm reaches no registry.
set -euo pipefail
cd "$(dirname "$0")"
for program in node npm; do
  command -v "$program" >/dev/null || { echo "tests/web: $program is not installed; skipped" >&2; exit 77; }
done
exec 9>modules.lock
flock 9  # several tests may start at once
if [ ! -e node_modules/.complete ] || [ package-lock.json -nt node_modules/.complete ]; then
  # Without install scripts: that of onnxruntime-node fetches libraries for NVIDIA cards.
  npm ci --ignore-scripts --no-audit --no-fund --loglevel=error >&2 ||
    { echo "tests/web: npm ci failed; skipped" >&2; exit 77; }
  touch node_modules/.complete
fi
