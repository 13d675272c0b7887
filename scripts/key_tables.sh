#!/usr/bin/env bash
# Writes the tables of keys in docs, between `<!-- keys: NAME -->` and `<!-- end -->`. Build the program first.
#   scripts/key_tables.sh
set -euo pipefail
cd "$(dirname "$0")/.."
doppel=${DOPPEL:-build/release/tools/doppel}
for page in docs/*.md; do
  grep -q '^<!-- keys: ' "$page" || continue
  copy=$(mktemp)
  while IFS= read -r line; do
    [ "$line" != '<!-- end -->' ] || inside=
    [ -n "${inside:-}" ] || printf '%s\n' "$line"
    if [[ $line =~ ^'<!-- keys: '([a-z]+)' -->'$ ]]; then
      inside=yes
      printf '\n'
      "$doppel" info --keys "${BASH_REMATCH[1]}"
      printf '\n'
    fi
  done <"$page" >"$copy"
  cat "$copy" >"$page"
  rm "$copy"
done
