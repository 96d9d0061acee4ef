#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# build.sh [auto|docker|local|virtual]: builds the C++ programs in build/bin (or $SLAMBED_BUILD/bin), once per state of the
# sources. With a Docker daemon they are compiled in the image build, otherwise (and for virtual runs) on this host.
set -euo pipefail

engine=${1:-auto}
root=$(cd "$(dirname "$0")/.." && pwd)
build=${SLAMBED_BUILD:-$root/build}
bin=$build/bin
# shellcheck source=tools/environment.sh
source "$root/tools/environment.sh"
# shellcheck source=tools/programs.sh
source "$root/tools/programs.sh"
# 'slambed setup' of an installed package, which has no harness/ next to these tools, sets both variables.
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
# A failed build's files go to the caller too.
trap 'give_to_caller "$build"' EXIT
cmake -S "$root" -B "$build" -G Ninja -DSLAMBED_TESTS=OFF -DSLAMBED_STATIC=ON -DSLAMBED_UNITY=ON >/dev/null
rm -f "$bin/sources.sha256"
# shellcheck disable=SC2086
ninja -C "$build" $programs
# Without this stamp the run key has the program's bytes, as another compiler may have produced other code.
if [ -z "$compiler" ]; then echo "$hash" >"$bin/sources.sha256"; fi
