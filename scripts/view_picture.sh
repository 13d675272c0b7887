#!/usr/bin/env bash
# Makes docs/images/view.jpg: `doppel view` of a run in a browser.   scripts/view_picture.sh RUN
set -euo pipefail
[ $# -eq 1 ] || { sed -n '2s/^# //p' "$0" >&2; exit 2; }
run="$(realpath "$1")"
cd "$(dirname "$0")/.."
tests/web/modules.sh
picture="$(mktemp --suffix .png)"
trap 'rm -f "$picture"' EXIT
CHROMIUM="$(command -v chromium)" node tests/web/check_view.mjs --picture "$picture" build/release/tools/doppel "$run"
convert "$picture" -quality 82 docs/images/view.jpg
