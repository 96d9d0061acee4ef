#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# build.sh [auto|docker|local|virtual]: the C++ programs in build/bin (or $SLAMBED_BUILD/bin), once per state of the sources.
# Where a Docker daemon answers they are compiled inside the image build, else (and for virtual runs) on this host.
set -euo pipefail

engine=${1:-auto}
root=$(cd "$(dirname "$0")/.." && pwd)
build=${SLAMBED_BUILD:-$root/build}
bin=$build/bin
# shellcheck source=tools/environment.sh
source "$root/tools/environment.sh"
# shellcheck source=tools/programs.sh
source "$root/tools/programs.sh"
# 'slambed setup' of an installed package says both: there is no harness/ beside these tools then.
hash=${SLAMBED_SOURCES:-$(PYTHONPATH="$root/harness" python3 -m slambed.spec.software)}
tag=slambed-node:$hash

if [ "$engine" = auto ]; then
  if docker info >/dev/null 2>&1; then engine=docker; else engine=local; fi
fi

if [ "$engine" = docker ]; then
  if programs_are_of "$hash" && docker image inspect "$tag" >/dev/null 2>&1; then exit 0; fi
  exec bash "$root/tools/build_image.sh" "$tag"
fi
if programs_are_of "$hash"; then exit 0; fi
bash "$root/tools/setup.sh" build
made_here "$build" "$root"
compiler=$(own_compiler)
if [ -n "$compiler" ]; then echo "building with $compiler"; fi
# Also what is there of a build that fails.
trap 'give_to_caller "$build"' EXIT
cmake -S "$root" -B "$build" -G Ninja -DSLAMBED_TESTS=OFF -DSLAMBED_STATIC=ON -DSLAMBED_UNITY=ON >/dev/null
rm -f "$bin/sources.sha256"
# shellcheck disable=SC2086
ninja -C "$build" $programs
# Without it runs are named by the bytes of the program: another compiler may have made others.
if [ -z "$compiler" ]; then echo "$hash" >"$bin/sources.sha256"; fi
