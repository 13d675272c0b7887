#!/usr/bin/env bash
# Runs the `sh` blocks of a page of docs/tasks from top to bottom in an empty folder.
#   run_page.sh PAGE FOLDER_OF_THE_PROGRAM CHECKOUT
set -euo pipefail
page="$1"; export PATH="$2:$PATH"; checkout="$3"
scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
awk '/^```sh/ {inside = 1; next} /^```/ {inside = 0; next} inside' "$page" > "$scratch/commands"
grep -q '[^[:space:]]' "$scratch/commands" || { echo "$page has no commands" >&2; exit 1; }
mkdir "$scratch/work"
cd "$scratch/work"
ln -s "$checkout/configs" configs
bash -euxo pipefail "$scratch/commands"
