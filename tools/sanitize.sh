#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# sanitize.sh asan|tsan [ctest arguments]: the C++ tests under AddressSanitizer and
# UndefinedBehaviorSanitizer, or under ThreadSanitizer. Every finding fails the test that found it.
set -euo pipefail

cd "$(dirname "$0")/.."
run=()
case ${1:-} in
  asan) sanitizers="address;undefined" ;;
  # Its shadow memory does not bear with the widest address randomisation.
  tsan) sanitizers=thread run=(setarch "$(uname -m)" -R) ;;
  *) echo "error: sanitize.sh '${1:-}': give asan or tsan" >&2; exit 2 ;;
esac
build=build-$1
shift
cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON -DSLAMBED_SANITIZE="$sanitizers" \
  -DCMAKE_CXX_FLAGS_RELEASE=-O1 >/dev/null
"${run[@]}" ninja -C "$build" --quiet ${SLAMBED_NINJA_FLAGS:-}
export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1
export UBSAN_OPTIONS=print_stacktrace=1
export TSAN_OPTIONS=second_deadlock_stack=1
"${run[@]}" ctest --test-dir "$build" --output-on-failure --no-tests=error "$@"
