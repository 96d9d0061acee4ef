#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# build_image.sh TAG: makes the node image. Nothing is compiled twice: static programs that this host has compiled from
# these sources go into the image; otherwise the image build compiles them, and they are copied to the host's build/bin.
set -euo pipefail

tag=$1
root=$(cd "$(dirname "$0")/.." && pwd)
bin=${SLAMBED_BUILD:-$root/build}/bin
# shellcheck source=tools/programs.sh
source "$root/tools/programs.sh"
# shellcheck source=tools/environment.sh
source "$root/tools/environment.sh"

bash "$root/tools/base_image.sh"
# Every Docker has the classic builder; it also builds all stages in order.
build=(docker build --label "slambed.image=$tag" -t "$tag")
if ! docker image inspect "$tag" >/dev/null 2>&1; then
  if programs_are_of "${tag#*:}" && programs_are_static; then
    echo "making image $tag out of build/bin"
    context=$(mktemp -d)
    trap 'rm -rf "$context"' EXIT
    # A machine without a compiler has no strip either; the programs of a wheel are stripped already.
    for program in $programs; do
      if command -v strip >/dev/null; then
        strip -o "$context/$program" "$bin/$program"
      else
        cp "$bin/$program" "$context/"
      fi
    done
    chmod 755 "$context"/*
    DOCKER_BUILDKIT=0 "${build[@]}" --quiet -f "$root/docker/programs.Dockerfile" "$context"
    exit 0
  fi
  echo "building image $tag: it compiles the C++, five to ten minutes on two cores, once per state of the sources"
  DOCKER_BUILDKIT=0 "${build[@]}" -f "$root/docker/Dockerfile" "$root"
fi
programs_are_of "${tag#*:}" && exit 0

# Only programs from exactly these sources get the stamp that runs check.
mkdir -p "$bin"
rm -f "$bin/sources.sha256"
container=$(docker create "$tag")
trap 'docker rm "$container" >/dev/null' EXIT
for program in $programs; do
  docker cp "$container:/usr/local/bin/$program" "$bin/$program" >/dev/null
done
echo "${tag#*:}" >"$bin/sources.sha256"
give_to_caller "$(dirname "$bin")"
echo "image $tag; programs in $bin"
