#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# wheel.sh BUILD_FOLDER OUT [PYTHON]: makes a wheel with the programs of BUILD_FOLDER/bin in the folder OUT. It installs on a
# machine without a compiler. PYTHON (default .venv/bin/python) has pip and setuptools. $STRIP and $SLAMBED_WHEEL_MACHINE are for
# programs of another architecture.
set -euo pipefail

bin=${1:?folder}/bin
out=${2:?folder}
root=$(cd "$(dirname "$0")/.." && pwd)
python=${3:-$root/.venv/bin/python}
# shellcheck source=tools/environment.sh
source "$root/tools/environment.sh"
# shellcheck source=tools/programs.sh
source "$root/tools/programs.sh"

programs_are_of "$(PYTHONPATH="$root/harness" "$python" -m slambed.spec.software)" || {
  echo "error: $bin has no programs of these sources; run 'make build'" >&2
  exit 3
}
programs_are_static || { echo "error: the programs in $bin need shared libraries; build with -DSLAMBED_STATIC=ON" >&2; exit 3; }
parts=$(mktemp -d)
trap 'rm -rf "$parts"; give_to_caller "$out"' EXIT
mkdir "$parts/bin" "$parts/licenses"
for program in $programs; do "${STRIP:-strip}" -o "$parts/bin/$program" "$bin/$program"; done
cp "$bin/sources.sha256" "$parts/bin"
# Static programs contain these libraries, so their licenses go along.
for package in libc6-dev libstdc++-"$(c++ -dumpversion)"-dev libeigen3-dev nlohmann-json3-dev libcli11-dev zlib1g-dev libturbojpeg0-dev; do
  cp "/usr/share/doc/$package/copyright" "$parts/licenses/$package"
done
chmod -R a+rX "$parts"
# Older files there would get into the wheel.
rm -rf "$root/build/wheel"
rm -f "$out"/slambed-*.whl
SLAMBED_WHEEL_BUILD=$parts "$python" -m pip wheel --quiet --no-deps --no-build-isolation --no-index -w "$out" "$root"
ls -l "$out"/slambed-*.whl | awk '{printf "%s: %.1f MB\n", $NF, $5 / 1e6}'
