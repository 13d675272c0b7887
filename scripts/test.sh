#!/usr/bin/env bash
# Installs missing packages, builds everything and runs all tests.
#   scripts/test.sh [PRESET]     release (default), debug or asan
#   scripts/test.sh nightly      the figures of docs/results on the studio capture, hours; needs DOPPEL_SHARED
# If DOPPEL_SHARED names the folder with the check data, tests labelled `real` also run; otherwise they are skipped.
set -euo pipefail
cd "$(dirname "$0")/.."
preset="${1:-release}"
selection=()
[ "$preset" != nightly ] || { preset=release && selection=(-C Nightly -L nightly); }
export CMAKE_BUILD_PARALLEL_LEVEL="${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}"

scripts/install_dependencies.sh tests
cmake --preset "$preset" >/dev/null
cmake --build --preset "$preset"
[ -n "${DOPPEL_SHARED:-}" ] || echo "DOPPEL_SHARED is not set: the tests labelled 'real' will be skipped."
# The tests run side by side with one thread each, which is faster than one test after the other. Tests of parallel code
# set their own number of threads. The allocator keeps freed memory, as in the program itself (core/process.h).
export OMP_NUM_THREADS=1 MALLOC_MMAP_MAX_=0 MALLOC_TRIM_THRESHOLD_=4294967296 MALLOC_TOP_PAD_=16777216
if [ ${#selection[@]} -gt 0 ]; then
  unset OMP_NUM_THREADS
  exec ctest --preset "$preset" "${selection[@]}"
fi
ctest --preset "$preset" --parallel "$CMAKE_BUILD_PARALLEL_LEVEL"
