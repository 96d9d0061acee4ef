#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# smoke.sh [all | EXPERIMENT ...]: three seconds of one run in virtual time, on short generated sequences as a machine without
# recordings has them: of a few experiments that play every system, of all experiments, or of those named. Fails when one
# cannot run.
set -euo pipefail

cd "$(dirname "$0")/.."
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
export SLAMBED_CACHE=$place/cache MPLCONFIGDIR=$place/matplotlib SLAMBED_DATA_BESIDE=no
unset SLAMBED_DATA
.venv/bin/python tools/smoke.py "$place" "$@"
