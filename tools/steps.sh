# SPDX-License-Identifier: Apache-2.0
# Sourced by check.sh and test.sh: named steps with their durations; the first failure does not hide the next one.
# What steps came to is in files: a lane of them may run in a process of its own.
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT
touch "$logs/failed" "$logs/durations"

step() {
  local name=$1 began=$SECONDS
  shift
  echo "== $name"
  "$@" || echo "$name" >>"$logs/failed"
  printf '%5s s  %s\n' $((SECONDS - began)) "$name" >>"$logs/durations"
}

checks() {
  step ruff .venv/bin/ruff check harness tools
  step format .venv/bin/ruff format --check harness tools
  step mypy .venv/bin/mypy harness/slambed
  step imports lint_imports
}

# Its banner says nothing.
lint_imports() {
  .venv/bin/lint-imports | sed -n '/^Contracts$/,$p'
  return "${PIPESTATUS[0]}"
}

# Durations, what a step kept for the end, and the exit status.
finish() {
  echo "== durations"
  cat "$logs/durations"
  printf '%5s s  %s\n' "$SECONDS" "everything"
  [ $# -eq 0 ] || cat "$@"
  if [ -s "$logs/failed" ]; then
    echo "error: failed: $(paste -sd ' ' "$logs/failed")" >&2
    exit 1
  fi
}
