#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# root.sh SUITE FOLDER [COMMAND ...]: makes a bare Debian (SUITE: bookworm, trixie) in FOLDER with debootstrap, if it is not
# there, and runs COMMAND in it, in a clone of the last commit at /slambed, or in a copy of these files where there is no
# history. Needs root. Network, processors, control groups, the lock of live runs and the caches of ccache and pip
# ($CCACHE_DIR, $PIP_CACHE_DIR, else those in ~/.cache) are the host's. $CC and $CXX are passed on. Nothing stays mounted, no
# process is left. SLAMBED_DEBIAN_ARCHITECTURE=arm64 makes one for another processor, if this kernel can run its programs
# (package qemu-user-static).
set -euo pipefail

suite=${1:?suite} folder=${2:?folder}
folder=${folder%/}
shift 2
top=$(cd "$(dirname "$0")/.." && pwd)
mirror=${SLAMBED_DEBIAN_MIRROR:-http://deb.debian.org/debian}
architecture=${SLAMBED_DEBIAN_ARCHITECTURE:-}
[ "$(id -u)" -eq 0 ] || { echo "error: debootstrap and chroot need root: sudo $0" >&2; exit 3; }

if [ ! -e "$folder/.made" ]; then
  # Only what an earlier call left may be removed.
  if [ -n "$(ls -A "$folder" 2>/dev/null)" ] && [ ! -e "$folder.partial" ]; then
    echo "error: $folder is not empty; give a new folder" >&2
    exit 2
  fi
  bash "$top/tools/setup.sh" image
  # shellcheck source=tools/retry.sh
  source "$top/tools/retry.sh"
  mkdir -p "$folder"
  folder=$(realpath "$folder")
  touch "$folder.partial"
  # A partial system from a failed attempt would make the next one fail.
  make_system() {
    rm -rf "$folder"
    debootstrap ${architecture:+--arch="$architecture"} --variant=minbase --include=ca-certificates,python3,python3-venv \
      "$suite" "$folder" "$mirror" >"$folder.log" 2>&1
  }
  echo "making $suite${architecture:+ for $architecture} in $folder (about two minutes)"
  thrice make_system || { tail -n 5 "$folder.log" >&2; echo "error: debootstrap failed three times, $mirror" >&2; exit 3; }
  touch "$folder/.made"
  rm "$folder.partial"
fi
[ $# -gt 0 ] || exit 0

folder=$(realpath "$folder")
exec 9>>"$folder/.made"
flock --nonblock 9 || { echo "error: another command runs in $folder; wait for it or take another folder" >&2; exit 3; }
# Also certificates of this host's own, for a mirror or a package index inside its network.
cp -L /etc/ssl/certs/ca-certificates.crt "$folder/etc/ssl/certs/ca-certificates.crt"
cp -L /etc/resolv.conf "$folder/etc/resolv.conf"
rm -rf "$folder/slambed"
# Under sudo the checkout is another user's, which git refuses.
settings=$(mktemp)
printf '[safe]\n\tdirectory = *\n' >"$settings"
export GIT_CONFIG_GLOBAL=$settings
if git -C "$top" rev-parse HEAD >/dev/null 2>&1; then
  git clone -q "file://$top" "$folder/slambed"
  git -C "$folder/slambed" checkout -q --detach "$(git -C "$top" rev-parse HEAD)"
else
  mkdir "$folder/slambed"
  tar -C "$top" --exclude=./build --exclude=./.venv --exclude=./results -c . | tar -C "$folder/slambed" -x
fi
rm -f "$settings"
mkdir -p "$folder/slambed/results" "$folder/run/lock"
# A root that is no mount point could have no namespaces of its own inside, which tests of several hosts need.
mounts='mount --bind "$0" "$0"; mount -t proc proc "$0/proc"; mount --rbind /dev "$0/dev"; mount --rbind /sys "$0/sys"; mount --bind /run/lock "$0/run/lock"'
caches=("${CCACHE_DIR:-$HOME/.cache/ccache}" "${PIP_CACHE_DIR:-$HOME/.cache/pip}")
mkdir -p "${caches[@]}" "$folder/root/.cache/ccache" "$folder/root/.cache/pip"
mounts+='; mount --bind "$1" "$0/root/.cache/ccache"; mount --bind "$2" "$0/root/.cache/pip"; shift 2'
# The namespaces take mounts and processes with them when the command ends. The last bash stays, because the first process of a
# namespace must wait for those whose parents are gone.
exec unshare --mount --pid --fork --kill-child bash -ec "$mounts"'
root=$0
exec env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 CCACHE_NOHASHDIR=1 \
  CCACHE_BASEDIR=/slambed CCACHE_DIR=/root/.cache/ccache PIP_CACHE_DIR=/root/.cache/pip ${CC:+CC="$CC"} ${CXX:+CXX="$CXX"} \
  chroot "$root" bash -c "cd /slambed && \"\$@\"; exit \$?" bash "$@"' "$folder" "${caches[@]}" "$@"
