#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# bench.sh: builds and runs every Google Benchmark program and the map growth benchmark. Results are in
# build-bench/*.json, medians.md, history.jsonl and growth.csv; docs/logbook is updated by hand.
set -euo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/environment.sh
source tools/environment.sh
made_here build-bench .
cmake -S . -B build-bench -G Ninja -DSLAMBED_TESTS=OFF -DSLAMBED_BENCHMARKS=ON >/dev/null
ninja -C build-bench --quiet ${SLAMBED_NINJA_FLAGS:-}
for program in build-bench/bin/*_bench; do
  name=$(basename "$program")
  echo "== $name"
  # Random order and medians, because the host's speed drifts over time.
  "$program" --benchmark_repetitions=5 --benchmark_enable_random_interleaving=true \
    --benchmark_report_aggregates_only=true --benchmark_out="build-bench/$name.json"
done
python3 tools/bench_summary.py --history build-bench/history.jsonl build-bench/*_bench.json | tee build-bench/medians.md
echo "== growth"
build-bench/bin/slam_growth "${KEYFRAMES:-2000}" | tee build-bench/growth.csv
python3 tools/growth_summary.py build-bench/growth.csv
