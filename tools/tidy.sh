#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# tidy.sh [--changed] BUILD_FOLDER [PATTERN]: runs clang-tidy on the product as it is compiled there, without tests and
# benchmarks, or on units whose name contains PATTERN. .clang-tidy has the checks. In a unity build a unit is several sources.
# --changed: only units that depend on a file changed since the last commit that passed ($SLAMBED_PASSED, else what .ci/run
# recorded), or all units if no such commit is known. Findings fail with the headers of GCC 12 only: newer ones cause others.
set -euo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/environment.sh
source tools/environment.sh
changed=
if [ "${1:-}" = --changed ]; then changed=yes; shift; fi
build=${1:?folder} pattern=${2:-}
made_here "$build" .
if [ ! -e "$build/compile_commands.json" ]; then
  cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON -DSLAMBED_STATIC=ON -DSLAMBED_UNITY=ON >/dev/null
fi
base=
if [ -n "$changed" ]; then
  base=${SLAMBED_PASSED:-$(cat "$(git rev-parse --git-path ci-passed 2>/dev/null)" 2>/dev/null || true)}
fi
if ! units=$(.venv/bin/python tools/tidy_units.py "$build" --pattern "$pattern" ${base:+--since "$base"}); then exit 2; fi
if [ -z "$units" ] && [ -n "$base" ]; then echo "clang-tidy: no unit changed since ${base:0:9}"; exit 0; fi
[ -n "$units" ] || { echo "error: no source of $build has '$pattern' in its name" >&2; exit 2; }
# clang does not know some of GCC's warnings and pragmas, and GCC's library has deprecations.
xargs -d "\n" -P "$(nproc)" -n 1 .venv/bin/clang-tidy -p "$build" --quiet --extra-arg=-Wno-unknown-warning-option \
  --extra-arg=-Wno-unknown-pragmas --extra-arg=-Wno-deprecated-declarations <<<"$units" \
  2> >(grep -vE '^[0-9]+ warnings?( and .*)? generated\.$' >&2) || {
  compiler=$(sed -n 's/^CMAKE_CXX_COMPILER:[A-Z]*=//p' "$build/CMakeCache.txt")
  if [ "$("$compiler" -dumpversion)" != 12 ]; then echo "note: clang-tidy found the above, with other headers than GCC 12's"; exit 0; fi
  echo "error: clang-tidy refuses the above" >&2
  exit 1
}
echo "clang-tidy: $(wc -l <<<"$units") units"
