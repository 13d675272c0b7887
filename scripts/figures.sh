# Functions of the scripts that write the tables of docs/results; source this file from the root of the repository.
# They need $folder, the folder of the runs.
doppel="${DOPPEL:-build/release/tools/doppel}"
[ -x "$doppel" ] || { scripts/install_dependencies.sh; cmake --preset release >/dev/null; cmake --build --preset release --target doppel; }

# provenance COMMAND: the lines below a table that say how it was made
provenance() {
  echo
  echo "\`$1\`, commit $(git rev-parse --short HEAD)$(git diff --quiet HEAD || echo ' with changes'), $(nproc) cores of $(grep -m1 'model name' /proc/cpuinfo | sed 's/.*: //'), $(date -u +%F)"
}

# figure FILE METHOD METRIC DIGITS: a metric of a method in the JSON of `doppel evaluate`, over the evaluated cameras
figure() {
  sed 's/"cameras":{[^}]*},*//g' "$folder/$1" | grep -o "\"$2\":{[^{}]*" | head -1 | grep -o "\"$3\":[0-9.e-]*" | head -1 |
    cut -d: -f2 | xargs -r printf "%.$4f"
}

# spread DIGITS: mean and largest distance from the mean of the numbers on standard input
spread() {
  awk -v d="$1" '{ x[NR] = $1; s += $1 }
    END { m = s / NR; for (i in x) { e = x[i] - m; if (e < 0) e = -e; if (e > w) w = e }; printf "%.*f ± %.*f", d, m, d, w }'
}
