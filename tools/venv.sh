#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# venv.sh [run|dev]: makes the Python environment in .venv exactly from requirements.lock (with hashes). dev: adds what tests
# and checks need (requirements-dev.lock has the same versions and more).
set -euo pipefail

kind=${1:-run}
root=$(cd "$(dirname "$0")/.." && pwd)
venv=$root/.venv
stamp=$venv/.locked
# shellcheck source=tools/environment.sh
source "$root/tools/environment.sh"
declare -A locks=([run]=requirements.lock [dev]=requirements-dev.lock)
[ -n "${locks[$kind]:-}" ] || { echo "error: venv.sh $kind: not one of run, dev" >&2; exit 2; }

# state KIND: prints the stamp of a complete environment of this kind.
state() { echo "$1 $(cat "$root/${locks[$1]}" "$root/pyproject.toml" | sha256sum)"; }

# Programs of an environment contain the folder's absolute path. In a moved tree they fail; in a copied tree they run the
# original tree's code.
made=$(sed -n 's/^command = .* -m venv //p' "$venv/pyvenv.cfg" 2>/dev/null || true)
again=
if [ -n "$made" ] && [ "$(realpath -m "$made")" != "$(realpath -m "$venv")" ]; then
  again=" again: it was made in $made"
  rm -rf "${venv:?}"
fi
if [ -x "$venv/bin/slambed" ]; then
  have=$(cat "$stamp" 2>/dev/null || true)
  if [ "$have" = "$(state dev)" ] || [ "$have" = "$(state "$kind")" ]; then exit 0; fi
fi
python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
  echo "error: $(python3 --version) is too old, slambed needs 3.11 or newer" >&2
  exit 3
}
"$root/tools/space.sh" 1500 ".venv"
# shellcheck source=tools/retry.sh
source "$root/tools/retry.sh"
echo "making .venv$again"
python3 -m venv "$venv"
thrice "$venv/bin/pip" install -q --require-hashes -r "$root/${locks[$kind]}"
thrice "$venv/bin/pip" install -q --no-deps -e "$root"
# Makes the environment independent of the tree's location: the path to the code is relative to site-packages, and the program
# uses the Python in its own folder.
for link in "$venv"/lib/python3*/site-packages/__editable__.slambed-*.pth; do echo ../../../../harness >"$link"; done
cat >"$venv/bin/slambed" <<'END'
#!/bin/sh
# Made by tools/venv.sh.
bin=$(dirname "$(readlink -f "$0")")
exec "$bin/python" -P -c 'import sys; sys.argv.pop(0); from slambed.start import main; main()' "$0" "$@"
END
chmod 755 "$venv/bin/slambed"
state "$kind" >"$stamp"
give_to_caller "$venv" "$root"/harness/*.egg-info
