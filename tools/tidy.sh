#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# tidy.sh [--changed] BUILD_FOLDER [PATTERN]: clang-tidy on all of the product as it is compiled there (tests and benchmarks
# left out), or on sources whose name has PATTERN. .clang-tidy says what is refused. In builds that compile several sources
# as one, a unit is such a lot. --changed: only units that hang on a file changed since the last commit that passed
# ($SLAMBED_PASSED, else what .ci/run wrote down); all of them where no such commit is known.
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
# gcc's own words: pragmas that clang does not know, its library's deprecations.
xargs -P "$(nproc)" -n 1 .venv/bin/clang-tidy -p "$build" --quiet --extra-arg=-Wno-unknown-warning-option \
  --extra-arg=-Wno-unknown-pragmas --extra-arg=-Wno-deprecated-declarations <<<"$units" \
  2> >(grep -vE '^[0-9]+ warnings?( and .*)? generated\.$' >&2) || { echo "error: clang-tidy refuses the above" >&2; exit 1; }
echo "clang-tidy: $(wc -l <<<"$units") units"
