#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# smoke.sh [EXPERIMENT ...]: three seconds of one run of every experiment and system (or of those named), in virtual time, on short
# generated sequences, as a machine without recordings has them. Fails when one cannot run.
set -euo pipefail

cd "$(dirname "$0")/.."
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
export SLAMBED_CACHE=$place/cache MPLCONFIGDIR=$place/matplotlib SLAMBED_DATA_BESIDE=no
unset SLAMBED_DATA
.venv/bin/python tools/smoke.py "$place" "$@"
