#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# arm64.sh FOLDER [test] [same] [image] [wheel]: compiles the programs for arm64, with Debian's cross-compiler in a bare Debian 12
# that it makes in FOLDER (tools/root.sh). The programs are in FOLDER/slambed/build/bin. Then, all if none is named:
# - test: compiles the C++ tests too, and runs those that need no real time under QEMU's emulation (an hour on two cores);
# - same: plays a frame-by-frame run, 20 virtual runs and the quickstart with the programs of this architecture (build/bin) and
#   of arm64, and compares the bytes;
# - image: makes the node image slambed-node:HASH-arm64, which `slambed run` copies to boards of that architecture.
# - wheel: makes the wheel FOLDER/slambed/build/dist/slambed-*_aarch64.whl, installs it in a bare Debian 12 for arm64, which it
#   makes in FOLDER-bare, and plays the quickstart there, under emulation (tools/try_wheel.sh).
# Needs root; `same` needs the programs, and with `wheel` the Python environment, of this checkout.
set -euo pipefail

# In the Debian, on the last commit: arm64.sh --inside [test].
if [ "${1:-}" = --inside ]; then
  cmake -S . -B build -G Ninja -DCMAKE_TOOLCHAIN_FILE=cmake/aarch64.cmake -DSLAMBED_STATIC=ON -DSLAMBED_UNITY=ON \
    -DSLAMBED_TESTS="$([ "${2:-}" = test ] && echo ON || echo OFF)" >cmake.log || { tail -n 20 cmake.log >&2; exit 1; }
  ninja -C build --quiet
  PYTHONPATH=harness python3 -m slambed.spec.software >build/bin/sources.sha256
  [ "${2:-}" != test ] ||
    ctest --test-dir build --label-exclude live --parallel "$(nproc)" --output-on-failure
  exit 0
fi

folder=${1:?folder}
shift
[ $# -gt 0 ] || set -- test same image wheel
for step in "$@"; do
  case $step in test | same | image | wheel) ;; *) echo "error: arm64.sh $step: not one of test, same, image, wheel" >&2; exit 2 ;; esac
done
wanted=" $* "
cd "$(dirname "$0")/.."
bash tools/setup.sh arm64
# The kernel starts arm64 programs through QEMU once this file system is mounted; in a container nobody has mounted it.
handlers=/proc/sys/fs/binfmt_misc
[ -e "$handlers/status" ] || mount -t binfmt_misc binfmt_misc "$handlers"
[ -e "$handlers/qemu-aarch64" ] || update-binfmts --enable qemu-aarch64
packages="make cmake ninja-build ccache g++-aarch64-linux-gnu qemu-user-static libeigen3-dev nlohmann-json3-dev libcli11-dev
  libturbojpeg0-dev:arm64 zlib1g-dev:arm64 libgtest-dev:arm64 libopencv-dev:arm64 libceres-dev:arm64"
if [ ! -e "$folder/.arm64" ]; then
  # shellcheck disable=SC2086
  bash tools/root.sh bookworm "$folder" sh -c 'dpkg --add-architecture arm64 && apt-get update -qq &&
    DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends "$@" >/dev/null' sh $packages
  touch "$folder/.arm64"
fi
test=""
if [[ $wanted == *" test "* ]]; then test="test"; fi
bash tools/root.sh bookworm "$folder" bash tools/arm64.sh --inside $test
build=$(realpath "$folder")/slambed/build
# Of the last commit, which root.sh clones: this checkout may have changes.
hash=$(cat "$build/bin/sources.sha256")
echo "programs for arm64: $build/bin"

if [[ $wanted == *" same "* ]]; then
  bash tools/same_bytes.sh build "$build"
  bash tools/same_runs.sh build/bin "$build/bin" quickstart --runs 1
fi
if [[ $wanted == *" image "* ]]; then
  source tools/programs.sh
  base=slambed-base:bookworm-arm64
  bash tools/base_image.sh "$base" arm64
  context=$(mktemp -d)
  trap 'rm -rf "$context"' EXIT
  for program in $programs; do aarch64-linux-gnu-strip -o "$context/$program" "$build/bin/$program"; done
  DOCKER_BUILDKIT=0 docker build --quiet --label "slambed.image=slambed-node:$hash-arm64" --build-arg "BASE=$base" \
    -t "slambed-node:$hash-arm64" -f docker/programs.Dockerfile "$context"
  python3 tools/label_image.py "slambed-node:$hash-arm64" arm64
fi
if [[ $wanted == *" wheel "* ]]; then
  STRIP=aarch64-linux-gnu-strip SLAMBED_WHEEL_MACHINE=aarch64 bash tools/wheel.sh "$build" "$build/dist"
  bare=$(realpath "$folder")-bare
  export SLAMBED_DEBIAN_ARCHITECTURE=arm64
  bash tools/root.sh bookworm "$bare"
  cp "$build"/dist/slambed-*_aarch64.whl "$bare/"
  bash tools/root.sh bookworm "$bare" sh -c 'tools/try_wheel.sh /slambed-*_aarch64.whl'
fi
