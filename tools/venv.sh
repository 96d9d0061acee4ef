#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The Python environment in .venv, exactly as requirements.lock says (hashes checked).
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
venv=$root/.venv
stamp=$venv/.locked
wanted=$(cat "$root/requirements.lock" "$root/pyproject.toml" | sha256sum)

if [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ] && [ -x "$venv/bin/slambed" ]; then
  exit 0
fi
python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
  echo "error: $(python3 --version) is too old, slambed needs 3.11 or newer" >&2
  exit 3
}
"$root/tools/space.sh" 1500 ".venv"
echo "making .venv"
python3 -m venv "$venv"
"$venv/bin/pip" install -q --require-hashes -r "$root/requirements.lock"
"$venv/bin/pip" install -q --no-deps -e "$root"
echo "$wanted" >"$stamp"
