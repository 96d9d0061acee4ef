#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# check.sh [PYTEST OPTION ...]: quick checks of a change: lint, format, types, import contracts, every C++ header by itself,
# and tests without programs.
set -uo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/steps.sh
source tools/steps.sh
checks
step "C++ headers" tools/alone.sh headers
step pytest .venv/bin/pytest -n auto --dist loadfile --no-loadscope-reorder \
  -m "not live and not programs" "$@"
finish
