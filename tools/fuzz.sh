#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# fuzz.sh [SECONDS [TARGET ...]]: builds the fuzz targets (all, or those named) with clang,
# AddressSanitizer and UBSan, and runs each for SECONDS (20). Inputs that crash one are left in build-fuzz/.
set -euo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/environment.sh
source tools/environment.sh
seconds=${1:-20}
shift || true
command -v clang++ >/dev/null || { echo "error: no clang++; install clang" >&2; exit 3; }
made_here build-fuzz .
cmake -S . -B build-fuzz -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DSLAMBED_FUZZ=ON -DSLAMBED_TESTS=OFF -DSLAMBED_UNITY=ON \
  -DCMAKE_CXX_FLAGS_RELEASE=-O1 -DCMAKE_CXX_FLAGS="-Wno-unknown-warning-option -Wno-unknown-pragmas" >/dev/null
ninja -C build-fuzz --quiet ${SLAMBED_NINJA_FLAGS:-} "${@:-fuzz_targets}"
if [ $# -eq 0 ]; then
  set -- $(cd build-fuzz/bin && ls | grep '_fuzz$')
fi
# One target runs on each core. After the first finding no other target starts.
fuzz() {
  local output
  output=$("build-fuzz/bin/$1" -max_total_time="$2" -max_len=4096 -rss_limit_mb=4096 -timeout=10 \
    -artifact_prefix=build-fuzz/ -print_final_stats=1 -verbosity=0 2>&1) || { echo "$output"; echo "error: $1 found a fault" >&2; exit 255; }
  echo "$1, $2 s: $(sed -n 's/^stat::number_of_executed_units: *//p' <<<"$output") inputs"
}
export -f fuzz
printf '%s\n' "$@" | xargs -P "$(nproc)" -I NAME bash -c "fuzz NAME $seconds"
