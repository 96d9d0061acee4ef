# SPDX-License-Identifier: Apache-2.0
# Sourced by check.sh and test.sh: named steps with their durations; the first failure does not hide the next one.
failed=()
durations=()

step() {
  local name=$1 began=$SECONDS
  shift
  echo "== $name"
  "$@" || failed+=("$name")
  durations+=("$(printf '%5s s  %s' $((SECONDS - began)) "$name")")
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
  printf '%s\n' "${durations[@]}"
  [ $# -eq 0 ] || cat "$@"
  if [ ${#failed[@]} -gt 0 ]; then
    echo "error: failed: ${failed[*]}" >&2
    exit 1
  fi
}
