#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# What stand_in_sim.py does when it just plays, in milliseconds: for campaigns of hundreds of runs.
mkdir mobile || exit 1
frame=0
while [ $frame -lt 5 ]; do
  echo "{\"t_ns\": ${frame}00000000, \"type\": \"frame_tracked\", \"frame\": $frame, \"seq_s\": 0.$frame, \"state\": \"ok\", \"track_ms\": 1.0, \"wait_ms\": 0.1}"
  echo "0.$frame $frame $((frame % 2)) 0 0 0 0 1" >&3
  frame=$((frame + 1))
done >mobile/events.jsonl 3>mobile/trajectory.txt
echo '{"role": "mobile", "exit_reason": "done", "stopped": false, "frames_total": 5, "version": "0"}' >mobile/node.json
