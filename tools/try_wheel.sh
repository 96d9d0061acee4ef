#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# try_wheel.sh WHEEL: installs a wheel of `make wheel` with its dependencies in an empty environment, plays the quickstart in
# virtual time, and fails without a table and a page. Prints seconds and megabytes. Of the system it needs python3 with venv.
set -euo pipefail

wheel=$(realpath "$1")
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cd "$place"
export SLAMBED_CACHE=$place/cache SLAMBED_DATA_BESIDE=no
unset PYTHONPATH SLAMBED_BIN
megabytes() { du -sm "$@" | awk '{print $1}'; }

for name in c++ cc g++ gcc clang; do
  if command -v "$name" >/dev/null; then echo "note: this system has $name, so this shows less"; fi
done
python3 -m venv own
began=$SECONDS
own/bin/pip install --quiet "$wheel"
installed=$SECONDS
own/bin/slambed run quickstart --engine virtual | tee table
ended=$SECONDS
grep -q '^offloaded .*ramp_0_85_0 ' table || { echo "error: no table" >&2; exit 1; }
[ -s results/quickstart/report/index.html ] || { echo "error: no page" >&2; exit 1; }
own/bin/slambed setup --engine virtual
. /etc/os-release
echo "$PRETTY_NAME, $(python3 --version): wheel $(megabytes "$wheel") MB, installed $(megabytes own) MB;" \
  "install $((installed - began)) s, quickstart $((ended - installed)) s"
