#!/usr/bin/env bash
# Builds the Debian packages doppel_*.deb (program, shared library, configurations) and libdoppel-dev_*.deb (headers,
# static libraries) in build/release.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/install_dependencies.sh packages
cmake --preset quickstart >/dev/null
cmake --build build/release --parallel "${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}"
cpack --config build/release/CPackConfig.cmake -B build/release
