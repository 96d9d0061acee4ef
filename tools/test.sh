#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# test.sh BUILD_FOLDER [all]: everything that must be green, with the time of every step. The C++ is compiled once, on this
# host: the node image is made out of the same programs. Then three lanes run side by side, each with a time limit: pytest's
# live tests, one at a time, which mostly wait; ctest's live programs; and, behind both in every queue for a CPU, all that
# computes. all: with what only the nightly needs (tests marked nightly, every experiment in smoke, clang-tidy on every unit).
# Ends with the summaries of ctest and pytest.
set -uo pipefail

cd "$(dirname "$0")/.."
export build=${1:-build} jobs
export all=${2:-}
jobs=$(nproc)
# shellcheck source=tools/steps.sh
source tools/steps.sh
# shellcheck source=tools/environment.sh
source tools/environment.sh
if [ -n "$(git status --porcelain 2>/dev/null)" ]; then
  echo "note: this tests the files as they are here: $(git status --porcelain | wc -l) of them are changed and not committed"
fi

# A compiler that we do not test with may warn of more: its warnings stop nobody.
werror=OFF
if [ "$(c++ -dumpversion 2>/dev/null)" = 12 ]; then werror=ON; fi

compile() {
  made_here "$build" . \
    && cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON -DSLAMBED_STATIC=ON -DSLAMBED_UNITY=ON \
      -DSLAMBED_WERROR=$werror >/dev/null \
    && rm -f "$build/bin/sources.sha256" \
    && ninja -C "$build" --quiet ${SLAMBED_NINJA_FLAGS:-} \
    && PYTHONPATH=harness python3 -m slambed.spec.software >"$build/bin/sources.sha256"
}

# Where user-mode Linux cannot be had, its one line says so and the rest goes on.
netem() {
  tools/netem_vm.sh || [ $? -eq 77 ]
}

# Not root, but may become it without being asked: what needs root is tested as root.
export sudo=
if [ "$(id -u)" -ne 0 ] && sudo -n true 2>/dev/null; then sudo="sudo --preserve-env=PATH,SLAMBED_STANDING env PYTHONDONTWRITEBYTECODE=1"; fi
export nightly=${all:+--nightly}

# Tests of one file share what they prepare, and stay in one process.
pytest_computing() {
  # shellcheck disable=SC2086
  logged pytest .venv/bin/pytest $nightly -n "$jobs" --strict-skips --dist loadfile --no-loadscope-reorder --durations=25 -m "not live"
}

# One at a time. What needs root is among them.
pytest_live() {
  # shellcheck disable=SC2086
  logged pytest_live $sudo .venv/bin/pytest $nightly --strict-skips --durations=25 -p no:cacheprovider -m live
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

# A browser that tests may open pages in.
browser() {
  local name
  for name in chromium chromium-browser google-chrome; do
    if command -v "$name"; then return; fi
  done
}

cpp_format() {
  find examples catalog/templates systems -name '*.[ch]pp' -o -name '*.h' | xargs .venv/bin/clang-format --dry-run -Werror
}

cpp_lint() {
  if [ -n "$all" ]; then tools/tidy.sh "$build"; else tools/tidy.sh --changed "$build"; fi
}

# What is compiled together may hide a missing include.
cpp_alone() {
  if [ -n "$all" ]; then tools/alone.sh all; else tools/alone.sh all 240; fi
}

ctest_of() {
  local name=$1
  shift
  logged "$name" ctest --test-dir "$build" --output-on-failure --no-tests=error "$@"
}

# Whatever of pytest looks at the clock or starts nodes.
live_lane() {
  step netem netem
  step "pytest, live" pytest_live
}

ctest_live_lane() {
  step "ctest, live" ctest_of ctest_live -L '^live$'
}

# Nodes and live tests go before this, by their priority and control groups.
computing_lane() {
  renice -n 19 -p $BASHPID >/dev/null
  checks
  step "C++ format" cpp_format
  step "C++ lint" cpp_lint
  step "C++ alone" cpp_alone
  step smoke tools/smoke.sh ${all:+all}
  if [ -n "$(recordings)" ]; then
    step recordings .venv/bin/pytest -m recordings "--recordings=$(recordings)" --durations=0 -v harness/tests
  else
    echo "== recordings: none beside this checkout; the tests that need them are left out"
  fi
  if [ -n "$(browser)" ]; then
    step browser .venv/bin/pytest -m browser "--browser=$(browser)" --durations=0 -v harness/tests
  else
    echo "== browser: no Chromium here; the tests that need it are left out (make test-browser installs it)"
  fi
  step ctest ctest_of ctest -LE '^live$' -j "$jobs"
  step pytest pytest_computing
}

step compile compile
# Where Docker is, its engine is tested with the real image; who may not speak to it may still test it as root.
as_docker=
if [ -n "$sudo" ] && ! docker info >/dev/null 2>&1; then as_docker=$sudo; fi
# shellcheck disable=SC2086
if $as_docker docker info >/dev/null 2>&1; then
  step image $as_docker tools/build.sh docker
fi
# What lanes call, they find in their environment.
export -f step logged checks lint_imports netem pytest_computing pytest_live recordings browser cpp_format cpp_lint cpp_alone \
  ctest_of live_lane ctest_live_lane computing_lane
limit_s=2400
[ -z "$all" ] || limit_s=7200
start_lane live $limit_s live_lane
start_lane "ctest, live" $limit_s ctest_live_lane
start_lane computing $limit_s computing_lane
wait_for_lane computing show
wait_for_lane "ctest, live"
wait_for_lane live
tail -q -n 12 "$logs/ctest" "$logs/ctest_live" >"$logs/ctest_end"
sed -s -n '/^skipped: \|^left out: \|^repeated: /p; $p' "$logs/pytest" "$logs/pytest_live" >"$logs/pytest_end"
finish "$logs/ctest_end" "$logs/pytest_end"
