#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# smoke.sh [all | EXPERIMENT ...]: plays three seconds of experiments in virtual time, one run per
# system and dataset, on short generated sequences, as on a machine without recordings: a few
# experiments that cover every system, all experiments, or the named ones. Fails if one cannot run.
set -euo pipefail

cd "$(dirname "$0")/.."
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
export SLAMBED_CACHE=$place/cache MPLCONFIGDIR=$place/matplotlib SLAMBED_DATA_BESIDE=no
unset SLAMBED_DATA
.venv/bin/python tools/smoke.py "$place" "$@"
