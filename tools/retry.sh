# SPDX-License-Identifier: Apache-2.0
# Sourced where something is loaded from a network.

# thrice COMMAND ...: up to three times, with a pause between, until it ends well. What it prints on standard error is shown
# each time; its exit status is the last one's.
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
