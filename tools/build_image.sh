#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# build_image.sh TAG: builds the node image, and copies its programs to build/bin of the host.
set -euo pipefail

tag=$1
root=$(cd "$(dirname "$0")/.." && pwd)
programs="slambed-node slambed-sim slambed-relay slambed-synth slambed-pace"

"$root/tools/base_image.sh"
if ! docker image inspect "$tag" >/dev/null 2>&1; then
  echo "building image $tag"
  # The classic builder is the one that every Docker has; it also builds all stages in order.
  DOCKER_BUILDKIT=0 docker build --quiet --label slambed.image="$tag" -t "$tag" -f "$root/docker/Dockerfile" "$root"
fi

# Only programs of these very sources get the stamp that runs ask for.
bin=$root/build/bin
mkdir -p "$bin"
rm -f "$bin/sources.sha256"
container=$(docker create "$tag")
trap 'docker rm "$container" >/dev/null' EXIT
for program in $programs; do
  docker cp "$container:/usr/local/bin/$program" "$bin/$program" >/dev/null
done
echo "${tag#*:}" >"$bin/sources.sha256"
echo "image $tag; programs in build/bin"
