#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# repeat_tests.sh FILE[::TEST] N [PYTEST OPTION ...]: runs tests N times on the host as it is, then N times next to one busy
# core, and counts failures and hangs. This finds tests that fail only once in thirty times. Exit status 1 if any execution
# did not pass; the output of failed executions is shown.
set -uo pipefail

cd "$(dirname "$0")/.."
[ $# -ge 2 ] && [ "$2" -gt 0 ] 2>/dev/null || { sed -n '3,5s/^# *//p' "$0" >&2; exit 2; }
tests=$1 count=$2
shift 2
limit_s=${SLAMBED_REPEAT_LIMIT_S:-1200}
log=$(mktemp)
busy=
leave() {
  [ -z "$busy" ] || kill "$busy" 2>/dev/null
  rm -f "$log"
}
trap leave EXIT
trap 'exit 130' INT TERM

bad=0
round() {
  local name=$1 n status passed=0 failed=0 hung=0 began=$SECONDS
  for ((n = 1; n <= count; n++)); do
    status=0
    timeout --kill-after=30 "$limit_s" .venv/bin/pytest --strict-skips -p no:cacheprovider "$tests" "${@:2}" >"$log" 2>&1 || status=$?
    case $status in
      0) passed=$((passed + 1)); continue ;;
      124 | 137) hung=$((hung + 1)) ;;
      *) failed=$((failed + 1)) ;;
    esac
    echo "-- $tests, $name, execution $n of $count: exit status $status"
    tail -n 60 "$log"
  done
  echo "$tests, $name: $passed passed, $failed failed, $hung hung, $((SECONDS - began)) s"
  bad=$((bad + failed + hung))
}

round "host as it is" "$@"
while :; do :; done &
busy=$!
round "beside a busy core" "$@"
[ "$bad" -eq 0 ]
