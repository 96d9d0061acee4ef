#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# sanitize.sh asan|tsan [TEST ...]: runs the C++ tests (all, or the named test programs) under
# AddressSanitizer and UndefinedBehaviorSanitizer, or under ThreadSanitizer. A finding fails its test.
set -euo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/environment.sh
source tools/environment.sh
run=()
case ${1:-} in
  asan) sanitizers="address;undefined" ;;
  # Its shadow memory conflicts with the widest address randomization.
  tsan) sanitizers=thread run=(setarch "$(uname -m)" -R) ;;
  *) echo "error: sanitize.sh '${1:-}': give asan or tsan" >&2; exit 2 ;;
esac
limit_s=3600  # per program: a deadlock is a finding too
build=build-$1
shift
made_here "$build" .
# Compiling several sources as one halves the time. tools/alone.sh finds the missing includes that this hides.
cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON -DSLAMBED_SANITIZE="$sanitizers" -DSLAMBED_UNITY=ON \
  -DCMAKE_CXX_FLAGS_RELEASE=-O1 >/dev/null
"${run[@]}" ninja -C "$build" --quiet ${SLAMBED_NINJA_FLAGS:-} "$@"

# Sanitizers write reports to files, because nobody reads the output of nodes that a test starts and kills. Reports of all
# processes count.
reports=$(realpath "$build")/reports
rm -rf "$reports"
mkdir "$reports"
export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1:log_path=$reports/asan
export UBSAN_OPTIONS=print_stacktrace=1:log_path=$reports/ubsan
export TSAN_OPTIONS=second_deadlock_stack=1:log_path=$reports/tsan

# Runs whole programs, not ctest's single cases, because their sequences are generated once, and slowly. Programs that
# depend on real time run last, one at a time.
live=$(ctest --test-dir "$build" -N -L '^live$' | sed -n 's/^ *Test *#[0-9]*: //p')
if [ $# -eq 0 ]; then
  set -- $(cd "$build/bin" && ls | grep '_test$')
fi
[ $# -gt 0 ] || { echo "error: no test program in $build/bin" >&2; exit 1; }

# Prints a program's output when it has ended, so that the lines of two programs do not mix.
play() {
  local test=$1 began=$SECONDS result=passed output=$reports.$1
  timeout "$limit_s" "${run[@]}" "$build/bin/$test" --gtest_brief=1 >"$output" 2>&1 || { result="failed ($?)"; touch "$output.failed"; }
  echo "$test: $result, $((SECONDS - began)) s"
  tail -n 200 "$output"
}
rm -f "$reports".*
for test in "$@"; do
  if grep -qx "$test" <<<"$live"; then continue; fi
  while [ "$(jobs -rp | wc -l)" -ge "$(nproc)" ]; do wait -n || true; done
  play "$test" &
done
wait
for test in "$@"; do
  if grep -qx "$test" <<<"$live"; then play "$test"; fi
done
failed=()
for test in "$@"; do
  if [ -e "$reports.$test.failed" ]; then failed+=("$test"); fi
done
for report in "$reports"/*; do
  [ -e "$report" ] || continue
  cat "$report"
  failed+=("$(basename "$report")")
done
if [ ${#failed[@]} -gt 0 ]; then
  echo "error: ${#failed[@]} failed: ${failed[*]}" >&2
  exit 1
fi
