#!/usr/bin/env bash
# Installs what is missing, builds everything and runs all tests.
#   scripts/test.sh [PRESET]     release (default), debug or asan
# With DOPPEL_SHARED set to a folder that holds the check data, tests labelled `real` run too; without it they skip.
set -euo pipefail
cd "$(dirname "$0")/.."
preset="${1:-release}"
export CMAKE_BUILD_PARALLEL_LEVEL="${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}"

scripts/install_dependencies.sh tests
cmake --preset "$preset" >/dev/null
cmake --build --preset "$preset"
[ -n "${DOPPEL_SHARED:-}" ] || echo "DOPPEL_SHARED is not set: the tests labelled 'real' will be skipped."
ctest --preset "$preset"
