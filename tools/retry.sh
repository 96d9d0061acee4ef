# SPDX-License-Identifier: Apache-2.0
# Sourced by scripts that download.

# thrice COMMAND ...: runs the command up to three times, with pauses, until it succeeds. Standard error of every attempt is
# shown; the exit status is that of the last one.
thrice() {
  local attempt status
  for attempt in 1 2 3; do
    status=0
    "$@" || status=$?
    [ "$status" -ne 0 ] || return 0
    [ "$attempt" -eq 3 ] || { echo "'$1 ${2:-}' failed (exit $status); trying again in $((5 * attempt)) s" >&2; sleep $((5 * attempt)); }
  done
  return "$status"
}
