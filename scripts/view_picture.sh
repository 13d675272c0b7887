#!/usr/bin/env bash
# Makes pictures of `doppel view` in a browser.
#   scripts/view_picture.sh RUN                   docs/images/view.jpg
#   scripts/view_picture.sh --cameras CAPTURE     docs/images/view_cameras.jpg
set -euo pipefail
usage() { sed -n '2,4s/^# //p' "$0" >&2; exit 2; }
option=--picture name=view
if [ "${1:-}" = --cameras ]; then option=--cameras name=view_cameras; shift; fi
[ $# -eq 1 ] || usage
target="$(realpath "$1")"
cd "$(dirname "$0")/.."
tests/web/modules.sh
picture="$(mktemp --suffix .png)"
trap 'rm -f "$picture"' EXIT
CHROMIUM="$(command -v chromium)" node tests/web/check_view.mjs "$option" "$picture" build/release/tools/doppel "$target"
convert "$picture" -quality 82 "docs/images/$name.jpg"
