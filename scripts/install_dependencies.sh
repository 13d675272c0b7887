#!/usr/bin/env bash
# Installs the packages of Debian 12 or 13 that Doppel needs. Prints nothing and does nothing if all are installed.
#   scripts/install_dependencies.sh            packages for building and running
#   scripts/install_dependencies.sh tests      also packages for the tests
#   scripts/install_dependencies.sh checks     also the tools of scripts/check.sh
#   scripts/install_dependencies.sh benchmarks also the libraries with which the benchmarks compare
#   scripts/install_dependencies.sh packages   also the tools that build Debian packages
#   scripts/install_dependencies.sh arm64      also the cross-compiler of scripts/arm64.sh
#   scripts/install_dependencies.sh docs       also the tools of scripts/docs.sh
#   scripts/install_dependencies.sh --list     prints the packages for building and running, and installs nothing
set -euo pipefail

packages=(
  cmake g++ ninja-build ccache pkg-config
  libtorch-dev libgloo-dev libopenblas-dev libopencv-dev libeigen3-dev libopenmesh-dev
  libyaml-cpp-dev libspdlog-dev libfmt-dev libcli11-dev nlohmann-json3-dev
  libpugixml-dev libtomlplusplus-dev libassimp-dev libtinygltf-dev libmeshoptimizer-dev libdraco-dev libonnx-dev libcpp-httplib-dev liboscpack-dev zlib1g-dev libminizip-dev
  liblmdb-dev libprotobuf-dev protobuf-compiler
  libdnnl-dev libflatbuffers-dev flatbuffers-compiler-dev flatbuffers-compiler libssl-dev
)
for extra in "$@"; do
  case "$extra" in
    tests)
      packages+=(libgtest-dev libgmock-dev libceres-dev python3-torch python3-numpy)
      # Ubuntu has Chromium as a snap alone, which containers cannot run. Without Chromium the tests in a browser are skipped.
      grep -qs '^ID=ubuntu' /etc/os-release || packages+=(chromium)
      ;;
    checks) packages+=(clang-format clang-tidy shellcheck python3-yaml) ;;
    benchmarks) packages+=(libembree-dev libosmesa6-dev libceres-dev) ;;
    packages) packages+=(dpkg-dev file) ;;
    docs) packages+=(doxygen doxygen-awesome-css python3-sphinx furo python3-myst-parser) ;;
    arm64) packages+=(g++-aarch64-linux-gnu qemu-user mmdebstrap) ;;
    --list) echo "${packages[*]}"; exit ;;
    *) echo "install_dependencies.sh: unknown set '$extra' (allowed: tests, checks, benchmarks, packages, arm64, docs, --list)" >&2; exit 2 ;;
  esac
done

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "These Debian packages are missing and need root to install: ${missing[*]}" >&2; exit 1; }
    as_root=(sudo)
  fi
  echo "Installing ${#missing[@]} packages: ${missing[*]}"
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null || {
    echo "Installing the packages failed. Debian 12 and 13 have all of them; docs/platforms.md lists what was tried." >&2
    exit 1
  }
fi

# The reference BLAS is many times slower than OpenBLAS. A new installation of OpenBLAS is selected automatically.
library_folder="/usr/lib/$(uname -m)-linux-gnu"
if ! readlink -f "$library_folder/libblas.so.3" | grep -q openblas; then
  echo "Note: libblas.so.3 is not OpenBLAS on this machine; choose it with: update-alternatives --config libblas.so.3-$(uname -m)-linux-gnu" >&2
fi
