#!/usr/bin/env bash
# Installs the package `doppel` into a bare Debian and runs the quickstart with the installed program. Needs root,
# debootstrap and the packages of scripts/package.sh.
#   scripts/check_package.sh bookworm|trixie ROOT      ROOT: an empty or new folder
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -eq 2 ] || { echo "usage: scripts/check_package.sh bookworm|trixie ROOT" >&2; exit 2; }
root="$2"
[ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase "$1" "$root"
mkdir -p "$root/doppel"
cp -r scripts configs "$root/doppel"
cp build/release/doppel_*.deb "$root/doppel/doppel.deb"
mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
trap 'umount "$root/proc"' EXIT
chroot "$root" sh -c 'apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends /doppel/doppel.deb >/dev/null'
chroot "$root" env DOPPEL=/usr/bin/doppel /doppel/scripts/quickstart.sh /doppel/demo
chroot "$root" sh -c 'echo "quickstart passed in Debian $(cat /etc/debian_version)"'
