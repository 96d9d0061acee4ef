# SPDX-License-Identifier: Apache-2.0
# Sourced by check.sh and test.sh: named steps with their durations; after a failure the next step still runs. Steps can run
# in parallel lanes, each with a time limit. Results of steps are in files, because every lane is its own process.
logs=$(mktemp -d)
export logs
trap 'end_lanes; rm -rf "$logs"' EXIT
trap 'exit 130' INT TERM
touch "$logs/failed" "$logs/durations"
lanes=()

step() {
  local name=$1 began=$SECONDS
  shift
  echo "== $name"
  "$@" || echo "$name" >>"$logs/failed"
  printf '%5s s  %s\n' $((SECONDS - began)) "$name" >>"$logs/durations"
}

# logged NAME COMMAND ...: shows the command's output and keeps it in the log of this name.
logged() {
  local name=$1
  shift
  "$@" 2>&1 | tee "$logs/$name"
  return "${PIPESTATUS[0]}"
}

# start_lane NAME LIMIT_S FUNCTION: runs the steps of an exported function in the background, in its own session, because
# kernels divide CPUs among sessions before they look at priorities. wait_for_lane shows its output. The lane is terminated
# after LIMIT_S. It does not inherit the lock of test.sh (9), which a program that it leaves behind would hold.
start_lane() {
  local name=$1 limit_s=${SLAMBED_LANE_LIMIT_S:-$2}
  mkdir -p "$logs/standing/$name"
  echo "$limit_s" >"$logs/limit_$name"
  # Created here, because a reader may start before the lane does.
  : >"$logs/lane_$name"
  SLAMBED_STANDING=$logs/standing/$name setsid timeout --verbose --kill-after=${SLAMBED_KILL_AFTER_S:-30} "$limit_s" bash -c "$3" >>"$logs/lane_$name" 2>&1 9<&- &
  lanes+=($!)
  echo $! >"$logs/pid_$name"
}

# wait_for_lane NAME [show]: waits for the end of a lane and prints its output; with show it prints while the lane runs.
wait_for_lane() {
  local name=$1 pid status=0 follower=
  pid=$(cat "$logs/pid_$name")
  if [ "${2:-}" = show ]; then
    tail -q -n +1 --pid="$pid" -f "$logs/lane_$name" &
    follower=$!
  fi
  wait "$pid" || status=$?
  if [ -n "$follower" ]; then wait "$follower"; else cat "$logs/lane_$name"; fi
  [ "$status" -ne 0 ] || return 0
  local what="ended with status $status before its steps had"
  if grep -q '^timeout: sending signal' "$logs/lane_$name"; then
    what="was still running after $(cat "$logs/limit_$name") s and was ended; it stood at: $(standing "$name")"
  fi
  echo "error: lane '$name' $what" | tee -a "$logs/late" >&2
  echo "lane $name" >>"$logs/failed"
}

# standing NAME: prints the tests that a lane has started but not ended: pytest's, which conftest.py records, then ctest's,
# whose log names each test at its start and end.
standing() {
  local found
  found=$(cat "$logs/standing/$1"/* 2>/dev/null | paste -sd ' ' -)
  found+=" $(sed -n 's/.*Start *\([0-9]*\): \(.*\)/\1 \2/p; s/.*Test *#\([0-9]*\): .*/\1/p' "$logs/lane_$1" |
    awk 'NF > 1 {begun[$1] = $2} NF == 1 {delete begun[$1]} END {for (n in begun) print begun[n]}' | paste -sd ' ' -)"
  found=${found# }
  found=${found% }
  echo "${found:-$(grep '^== ' "$logs/lane_$1" | tail -n 1 || true)}"
}

end_lanes() {
  local pid
  for pid in "${lanes[@]}"; do kill -TERM -- "-$pid" 2>/dev/null; done
}

checks() {
  step ruff .venv/bin/ruff check harness tools
  step format .venv/bin/ruff format --check harness tools
  step mypy .venv/bin/mypy harness/slambed
  step imports lint_imports
  step spelling .venv/bin/codespell
}

# Without the banner.
lint_imports() {
  .venv/bin/lint-imports | sed -n '/^Contracts$/,$p'
  return "${PIPESTATUS[0]}"
}

# Prints the commit, and how many files differ from it.
tested() {
  local commit changed
  commit=$(git rev-parse --short HEAD 2>/dev/null) || { echo "sources without git"; return; }
  changed=$(git status --porcelain 2>/dev/null | wc -l)
  if [ "$changed" -eq 0 ]; then echo "$commit"; else echo "$commit with $changed files changed and not committed"; fi
}

# finish [FILE ...]: prints durations, the result with the commit, and these files (summaries of the test runners). Exits with
# 1 if a step failed.
finish() {
  local result=passed
  [ ! -s "$logs/failed" ] || result=failed
  echo "== durations"
  cat "$logs/durations"
  printf '%5s s  %s\n' "$SECONDS" "everything"
  echo "== $result: $(tested)"
  [ $# -eq 0 ] || cat "$@"
  # Repeated at the end, where it is seen.
  [ ! -e "$logs/late" ] || cat "$logs/late" >&2
  if [ $result = failed ]; then
    echo "error: failed: $(paste -sd ' ' "$logs/failed")" >&2
    exit 1
  fi
}
