#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# root.sh SUITE FOLDER [COMMAND ...]: makes a bare Debian (SUITE: bookworm, trixie) in FOLDER with debootstrap, if it is not
# there, and runs COMMAND in it, in a copy of this commit at /slambed, or of these files where there is no history. Needs root.
# Nothing stays mounted and no process is left. Caches of ccache and pip are the host's: $CCACHE_DIR and $PIP_CACHE_DIR, else
# those in ~/.cache. The command sees the host's network and processors; it has no control groups and no Docker.
set -euo pipefail

suite=${1:?suite} folder=${2:?folder}
shift 2
top=$(cd "$(dirname "$0")/.." && pwd)
mirror=${SLAMBED_DEBIAN_MIRROR:-http://deb.debian.org/debian}
[ "$(id -u)" -eq 0 ] || { echo "error: debootstrap and chroot need root: sudo $0" >&2; exit 3; }

if [ ! -e "$folder/.made" ]; then
  bash "$top/tools/setup.sh" image
  # shellcheck source=tools/retry.sh
  source "$top/tools/retry.sh"
  mkdir -p "$folder"
  folder=$(realpath "$folder")
  make_system() {
    debootstrap --variant=minbase --include=ca-certificates,python3,python3-venv "$suite" "$folder" "$mirror" >"$folder.log" 2>&1
  }
  echo "making $suite in $folder (about two minutes)"
  thrice make_system || { tail -n 5 "$folder.log" >&2; echo "error: debootstrap failed three times, $mirror" >&2; exit 3; }
  touch "$folder/.made"
fi
[ $# -gt 0 ] || exit 0

folder=$(realpath "$folder")
# Also certificates of this host's own, for a mirror or a package index inside its network.
cp -L /etc/ssl/certs/ca-certificates.crt "$folder/etc/ssl/certs/ca-certificates.crt"
cp -L /etc/resolv.conf "$folder/etc/resolv.conf"
rm -rf "$folder/slambed"
if git -C "$top" rev-parse HEAD >/dev/null 2>&1; then
  git clone -q "file://$top" "$folder/slambed"
  git -C "$folder/slambed" checkout -q --detach "$(git -C "$top" rev-parse HEAD)"
else
  mkdir "$folder/slambed"
  tar -C "$top" --exclude=./build --exclude=./.venv --exclude=./results -c . | tar -C "$folder/slambed" -x
fi
mkdir -p "$folder/slambed/results"
mounts='mount -t proc proc "$0/proc"; mount --rbind /dev "$0/dev"; mount -t sysfs sysfs "$0/sys"'
for cache in ccache pip; do
  variable=${cache^^}_DIR
  [ $cache = ccache ] || variable=PIP_CACHE_DIR
  place=${!variable:-$HOME/.cache/$cache}
  mkdir -p "$place" "$folder/root/.cache/$cache"
  mounts+="; mount --bind '$place' \"\$0/root/.cache/$cache\""
done
# The namespaces take mounts and processes with them when the command ends.
exec unshare --mount --pid --fork --kill-child bash -ec "$mounts"'
root=$0
exec env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 CCACHE_NOHASHDIR=1 \
  CCACHE_BASEDIR=/slambed CCACHE_DIR=/root/.cache/ccache PIP_CACHE_DIR=/root/.cache/pip ${CC:+CC="$CC"} ${CXX:+CXX="$CXX"} \
  chroot "$root" bash -c "cd /slambed && exec \"\$@\"" bash "$@"' "$folder" "$@"
