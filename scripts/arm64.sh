#!/usr/bin/env bash
# Cross-builds for arm64 on a Debian 12 of another architecture and runs the tests of the kernels under qemu-user. Needs
# root and about 3 GB.
#   scripts/arm64.sh ROOT [TARGET...]     ROOT: the folder for Debian's arm64 packages; it is made if it is missing
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 1 ] || { echo "usage: scripts/arm64.sh ROOT [TARGET...]" >&2; exit 2; }
root="$(realpath -m "$1")"
shift
tests=("$@")
[ ${#tests[@]} -gt 0 ] || tests=(core_test layers_test render_test losses_test)
scripts/install_dependencies.sh tests arm64

if [ ! -e "$root/complete" ]; then
  packages="$(scripts/install_dependencies.sh --list | tr ' ' '\n' | grep -E -- '-dev$|-dev3$|zlib1g' | paste -sd,)"
  mmdebstrap --variant=extract --architectures=arm64 --include="$packages,libgtest-dev,libgmock-dev,libgomp1" bookworm "$root"
  # The packages are unpacked and not configured: merge /lib into /usr/lib, make links relative, choose the BLAS.
  cp -a "$root/lib/." "$root/usr/lib/" && rm -r "${root:?}/lib" && ln -s usr/lib "$root/lib"
  find "$root" -type l -lname '/*' -print0 | while IFS= read -r -d '' link; do
    ln -sfnr "$root$(readlink "$link")" "$link"
  done
  libraries="$root/usr/lib/aarch64-linux-gnu"
  ln -sf openblas-pthread/libblas.so.3 "$libraries/libblas.so.3"
  ln -sf openblas-pthread/liblapack.so.3 "$libraries/liblapack.so.3"
  ln -sf openblas-pthread/libopenblas.so.0 "$libraries/libopenblas.so.0"
  # Draco's CMake package names its files from the root of the file system.
  sed -i "s#/usr/lib/aarch64-linux-gnu#$libraries#g" "$libraries"/cmake/draco/*.cmake
  touch "$root/complete"
fi

export ARM64_ROOT="$root"
cmake --preset release -B build/arm64 --toolchain cmake/arm64-linux.cmake
cmake --build build/arm64 --target "${tests[@]}"
for name in "${tests[@]}"; do
  ctest --test-dir build/arm64 -R "^${name%_test}\$" --output-on-failure
done
