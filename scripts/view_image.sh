#!/usr/bin/env bash
# Makes images of `doppel view` in a browser.
#   scripts/view_image.sh RUN                   docs/images/view.jpg
#   scripts/view_image.sh --cameras CAPTURE     docs/images/view_cameras.jpg
set -euo pipefail
usage() { sed -n '2,4s/^# //p' "$0" >&2; exit 2; }
option=--picture name=view
if [ "${1:-}" = --cameras ]; then option=--cameras name=view_cameras; shift; fi
[ $# -eq 1 ] || usage
target="$(realpath "$1")"
cd "$(dirname "$0")/.."
tests/web/modules.sh
image="$(mktemp --suffix .png)"
trap 'rm -f "$image"' EXIT
CHROMIUM="$(command -v chromium)" node tests/web/check_view.mjs "$option" "$image" build/release/tools/doppel "$target"
convert "$image" -quality 82 "docs/images/$name.jpg"
