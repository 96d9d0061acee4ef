#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# test.sh BUILD_FOLDER [all]: runs all checks and tests, with the duration of every step. The C++ is compiled once, on this
# host, and the node image is made from the same programs. Then three lanes run in parallel, each with a time limit: pytest's
# live tests, one at a time, which mostly wait; ctest's live programs; and, at lower priority, everything that computes. all:
# adds what only the nightly needs (tests marked nightly, every experiment in smoke, clang-tidy on every unit). Ends with the
# summaries of ctest and pytest.
set -uo pipefail

cd "$(dirname "$0")/.."
export build=${1:-build} jobs
export all=${2:-}
jobs=$(nproc)
# shellcheck source=tools/steps.sh
source tools/steps.sh
# shellcheck source=tools/environment.sh
source tools/environment.sh
if ! git rev-parse --git-dir >/dev/null 2>&1; then
  echo "note: an archive, or no git here: tests that need the history are left out, and clang-tidy reads all units"
fi
if [ -n "$(git status --porcelain 2>/dev/null)" ]; then
  echo "note: this tests the files as they are here: $(git status --porcelain | wc -l) of them are changed and not committed"
fi
# Two suites on one host would remove each other's containers, and each would make the other's live tests late.
exec 9</tmp
if ! flock --nonblock 9; then
  echo "waiting: the tests of another checkout run on this host"
  flock 9
fi

# Warnings are errors only with GCC 12, because other compilers may warn of more.
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

# If user-mode Linux cannot run here (77), the script says so in one line and the tests continue.
netem() {
  tools/netem_vm.sh || [ $? -eq 77 ]
}

# With passwordless sudo, tests that need root run as root.
export sudo=
if [ "$(id -u)" -ne 0 ] && sudo -n true 2>/dev/null; then sudo="sudo --preserve-env=PATH,SLAMBED_STANDING env PYTHONDONTWRITEBYTECODE=1"; fi
export nightly=${all:+--nightly}

# Tests of one file share their fixtures, so they stay in one process.
pytest_computing() {
  # shellcheck disable=SC2086
  logged pytest .venv/bin/pytest $nightly -n "$jobs" --strict-skips --dist loadfile --no-loadscope-reorder --durations=25 -m "not live"
}

# Live tests run one at a time; some of them need root.
pytest_live() {
  # shellcheck disable=SC2086
  logged pytest_live $sudo .venv/bin/pytest $nightly --strict-skips --durations=25 -p no:cacheprovider -m live
}

# Prints the folders with recordings, separated by colons: SLAMBED_TEST_RECORDINGS, else the usual data folders.
recordings() {
  local folder found='' given
  if [ -n "${SLAMBED_TEST_RECORDINGS+set}" ]; then echo "$SLAMBED_TEST_RECORDINGS"; return; fi
  IFS=: read -ra given <<<"${SLAMBED_DATA:-}"
  for folder in "${given[@]}" data ../shared/data; do
    if [ -d "$folder" ]; then found=$found:$(realpath "$folder"); fi
  done
  echo "${found#:}"
}

# Prints the path of a browser for tests, if there is one.
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

# Finds missing includes that compiling several sources as one hides.
cpp_alone() {
  if [ -n "$all" ]; then tools/alone.sh all; else tools/alone.sh all 240; fi
}

ctest_of() {
  local name=$1
  shift
  logged "$name" ctest --test-dir "$build" --output-on-failure --no-tests=error "$@"
}

# Python tests that depend on real time or start nodes.
live_lane() {
  step netem netem
  step "pytest, live" pytest_live
}

ctest_live_lane() {
  step "ctest, live" ctest_of ctest_live -L '^live$'
}

# This lane has the lowest priority, so that nodes and live tests get the CPUs first.
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
# With Docker, its engine is tested with the real image; through sudo if this user may not use Docker.
as_docker=
if [ -n "$sudo" ] && ! docker info >/dev/null 2>&1; then as_docker=$sudo; fi
# shellcheck disable=SC2086
if $as_docker docker info >/dev/null 2>&1; then
  step image $as_docker tools/build.sh docker
fi
# Lanes are other shells, so their functions must be exported.
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
