#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# test.sh BUILD_FOLDER: everything that must be green. Ends with the summaries of ctest and pytest.
set -uo pipefail

cd "$(dirname "$0")/.."
build=${1:-build}
failed=()

step() {
  local name=$1
  shift
  echo "== $name"
  "$@" || failed+=("$name")
}

compile() {
  cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON >/dev/null \
    && rm -f "$build/bin/sources.sha256" \
    && ninja -C "$build" --quiet \
    && PYTHONPATH=harness python3 -m slambed.spec.software >"$build/bin/sources.sha256"
}

# Where user-mode Linux cannot be had, its one line says so and the rest goes on.
netem() {
  tools/netem_vm.sh || [ $? -eq 77 ]
}

# Where Docker is, its engine is tested with the real image.
if docker info >/dev/null 2>&1; then
  step image tools/build.sh docker
fi
step ruff .venv/bin/ruff check harness
step format .venv/bin/ruff format --check harness
step mypy .venv/bin/mypy harness/slambed
step compile compile
step netem netem
step ctest ctest --test-dir "$build" --output-on-failure --no-tests=error
step pytest .venv/bin/pytest

if [ ${#failed[@]} -gt 0 ]; then
  echo "error: failed: ${failed[*]}" >&2
  exit 1
fi
