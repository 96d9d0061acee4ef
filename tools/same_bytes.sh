#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# same_bytes.sh BUILD_A BUILD_B [SECONDS]: plays a generated sequence frame by frame, sequentially,
# with the nodes of two builds (e.g. with and without sanitizers) and compares their trajectories; then
# compares one cell of 20 virtual runs.
set -euo pipefail

a=$(realpath "$1") b=$(realpath "$2") seconds=${3:-4}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$(dirname "$0")/.."
params=$(PYTHONPATH=harness "${PYTHON:-.venv/bin/python}" -c '
import json
from slambed.spec.library import Library
print(json.dumps(Library().system("orbslam2").resolve("default", {"sequential": True})))')
"$a/bin/slambed-synth" --out "$work/sequence" --seconds "$seconds" --fps 10 --id walk --seed 3 >/dev/null

play() {
  local name=$1 build=$2
  mkdir "$work/$name"
  cat >"$work/$name/run.json" <<END
{"format": "slambed-run", "version": 1, "run_key": "same", "seed": 1, "system": "orbslam2", "variant": "default",
 "params": $params,
 "sequence": "$work/sequence", "network": null, "output": "$work/$name", "connect_timeout_s": 1.0,
 "playback": {"mode": "every_frame", "fps": null, "start_s": 0.0, "end_s": null}}
END
  echo '{"t0_ns": 1}' >"$work/$name/start.json"
  "$build/bin/slambed-node" --role mobile --config "$work/$name/run.json"
}
play a "$a"
play b "$b"
for file in trajectory.txt trajectory_live.txt; do
  cmp "$work/a/mobile/$file" "$work/b/mobile/$file"
done
poses=$(grep -vc '^#' "$work/a/mobile/trajectory.txt" || true)
[ "$poses" -gt 0 ] || { echo "error: nothing was tracked" >&2; exit 1; }
echo "same bytes: $poses poses, $(sha256sum <"$work/a/mobile/trajectory.txt" | cut -c1-16)"
PYTHONPATH=harness:harness/tests "${PYTHON:-.venv/bin/python}" tools/same_cell.py "$a/bin" "$b/bin" 20
