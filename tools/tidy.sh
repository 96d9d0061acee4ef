#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# tidy.sh BUILD_FOLDER [PATTERN]: clang-tidy on all of the product as it is compiled there (tests and benchmarks left
# out), or on sources whose name has PATTERN. .clang-tidy says what is refused. In builds that compile several sources
# as one, a unit is such a lot.
set -euo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/environment.sh
source tools/environment.sh
build=${1:?folder} pattern=${2:-}
made_here "$build" .
if [ ! -e "$build/compile_commands.json" ]; then
  cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON -DSLAMBED_STATIC=ON -DSLAMBED_UNITY=ON >/dev/null
fi
units=$(.venv/bin/python - "$build/compile_commands.json" "$pattern" <<'END'
import json, re, sys
units = {item["file"] for item in json.load(open(sys.argv[1]))}
print(*sorted(u for u in units if not re.search(r"_test_together/|/(tests|bench|fuzz)/", u) and sys.argv[2] in u), sep="\n")
END
)
[ -n "$units" ] || { echo "error: no source of $build has '$pattern' in its name" >&2; exit 2; }
# gcc's own words: pragmas that clang does not know, its library's deprecations.
xargs -P "$(nproc)" -n 1 .venv/bin/clang-tidy -p "$build" --quiet --extra-arg=-Wno-unknown-warning-option \
  --extra-arg=-Wno-unknown-pragmas --extra-arg=-Wno-deprecated-declarations <<<"$units" \
  2> >(grep -vE '^[0-9]+ warnings?( and .*)? generated\.$' >&2) || { echo "error: clang-tidy refuses the above" >&2; exit 1; }
echo "clang-tidy: $(wc -l <<<"$units") units"
