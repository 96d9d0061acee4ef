#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# check.sh [PYTEST OPTION ...]: what a change of Python needs: lint, format, types, import contracts, pure tests.
set -uo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/steps.sh
source tools/steps.sh
checks
step pytest .venv/bin/pytest -n auto --dist loadfile --no-loadscope-reorder \
  -m "not live and not programs" "$@"
finish
