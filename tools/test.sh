#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# test.sh BUILD_FOLDER: everything that must be green, with the time of every step. The C++ is compiled once, on this
# host: the node image is made out of the same programs. Ends with the summaries of ctest and pytest.
set -uo pipefail

cd "$(dirname "$0")/.."
build=${1:-build}
jobs=$(nproc)
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT
# shellcheck source=tools/steps.sh
source tools/steps.sh

compile() {
  cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON -DSLAMBED_STATIC=ON >/dev/null \
    && rm -f "$build/bin/sources.sha256" \
    && ninja -C "$build" --quiet ${SLAMBED_NINJA_FLAGS:-} \
    && PYTHONPATH=harness python3 -m slambed.spec.software >"$build/bin/sources.sha256"
}

# Where user-mode Linux cannot be had, its one line says so and the rest goes on.
netem() {
  tools/netem_vm.sh || [ $? -eq 77 ]
}

# What is run with "$@" shows all it says, and leaves it in the log of this name.
logged() {
  local name=$1
  shift
  "$@" 2>&1 | tee "$logs/$name"
  return "${PIPESTATUS[0]}"
}

# Not root, but may become it without being asked: what needs root is tested as root.
sudo=
if [ "$(id -u)" -ne 0 ] && sudo -n true 2>/dev/null; then sudo="sudo --preserve-env=PATH env PYTHONDONTWRITEBYTECODE=1"; fi

# Tests of one file share what they prepare, and stay in one process; live ones of any file wait for each other.
pytest_all() {
  local options=(--strict-skips --dist loadfile --no-loadscope-reorder --durations=15)
  if [ -z "$sudo" ]; then
    logged pytest .venv/bin/pytest -n "$jobs" "${options[@]}"
    return
  fi
  local good=0
  logged pytest_user .venv/bin/pytest -n "$jobs" "${options[@]}" -m "not live" || good=1
  logged pytest $sudo .venv/bin/pytest "${options[@]}" -p no:cacheprovider -m live || good=1
  return $good
}

# Folders with recordings, a colon list: those that SLAMBED_TEST_RECORDINGS names, else those where data is looked for.
recordings() {
  local folder found=
  if [ -n "${SLAMBED_TEST_RECORDINGS+set}" ]; then echo "$SLAMBED_TEST_RECORDINGS"; return; fi
  for folder in ${SLAMBED_DATA:+${SLAMBED_DATA//:/ }} data ../shared/data; do
    if [ -d "$folder" ]; then found=$found:$(realpath "$folder"); fi
  done
  echo "${found#:}"
}

checks
step compile compile
# Where Docker is, its engine is tested with the real image.
if docker info >/dev/null 2>&1; then
  step image tools/build.sh docker
fi
step netem netem
step smoke tools/smoke.sh
if [ -n "$(recordings)" ]; then
  step recordings .venv/bin/pytest -m recordings "--recordings=$(recordings)" --durations=0 -v harness/tests
else
  echo "== recordings: none beside this checkout; the tests that need them are left out"
fi
step ctest logged ctest ctest --test-dir "$build" -j "$jobs" --output-on-failure --no-tests=error
step pytest pytest_all
tail -n 12 "$logs/ctest" >"$logs/ctest_end"
sed -s -n '/^skipped: \|^left out: /p; $p' "$logs"/pytest* >"$logs/pytest_end"
finish "$logs/ctest_end" "$logs/pytest_end"
