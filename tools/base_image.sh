#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# base_image.sh [IMAGE] [ARCHITECTURE]: makes sure that a base image exists (debian:bookworm-slim): pulls it, or makes one of
# Debian with debootstrap. With an architecture, such as arm64, it is always made, since a pulled image would take the place of
# this machine's own; the name ends in SUITE-ARCHITECTURE, and this machine must be able to execute such programs (QEMU).
set -euo pipefail

image=${1:-debian:bookworm-slim}
architecture=${2:-}
suite=${image#*:}
suite=${suite%-slim}
suite=${suite%"-$architecture"}
mirror=${SLAMBED_DEBIAN_MIRROR:-http://deb.debian.org/debian}
pull_timeout_s=120

if ! command -v docker >/dev/null; then
  echo "error: no docker command; install docker.io or docker-cli" >&2
  exit 3
fi
if docker image inspect "$image" >/dev/null 2>&1; then
  exit 0
fi
if [ -z "$architecture" ]; then
  echo "pulling $image"
  if timeout "$pull_timeout_s" docker pull -q "$image"; then
    exit 0
  fi
  if [[ $image != debian:* ]]; then
    echo "error: cannot pull $image; check the network, or load the image with 'docker load'" >&2
    exit 3
  fi
  echo "cannot pull $image: making it with debootstrap (about a minute)"
fi
if [ "$(id -u)" -ne 0 ]; then
  why="$image cannot be pulled; run 'sudo make images'"
  if [ -n "$architecture" ]; then why="which makes $image"; fi
  echo "error: debootstrap needs root, $why" >&2
  exit 3
fi
bash "$(dirname "$0")/setup.sh" image
# shellcheck source=tools/retry.sh
source "$(dirname "$0")/retry.sh"
folder=$(mktemp -d /var/tmp/slambed-base.XXXXXX)
trap 'rm -rf "$folder"' EXIT
# A partial system from a failed attempt would make the next one fail.
make_system() {
  rm -rf "$folder"
  debootstrap ${architecture:+--arch="$architecture"} --variant=minbase --include=ca-certificates "$suite" "$folder" "$mirror" >"$folder.log" 2>&1
}
thrice make_system || {
  tail -n 5 "$folder.log" >&2
  rm -f "$folder.log"
  echo "error: debootstrap failed three times, $mirror; check the network or set SLAMBED_DEBIAN_MIRROR" >&2
  exit 3
}
rm -f "$folder.log"
# apt's caches would only make the image larger.
rm -rf "$folder"/var/cache/apt/archives/*.deb "$folder"/var/lib/apt/lists/*
# Docker labels it with this machine's architecture: tools/label_image.py corrects that in what is built on it.
tar -C "$folder" -c . | docker import - "$image"
