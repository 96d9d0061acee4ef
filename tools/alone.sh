#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# alone.sh headers|all [SECONDS]: compiles every header by itself; all: every source, test and header by itself, as a
# developer's build does. Users' builds compile several sources as one, which hides missing includes that a neighbor file
# provides. Nothing is linked. With a warm ccache this takes a minute; otherwise it stops after SECONDS and a line says how
# much was left out.
set -euo pipefail

cd "$(dirname "$0")/.."
# shellcheck source=tools/environment.sh
source tools/environment.sh
what=${1:?headers or all} limit_s=${2:-0}
case $what in
  headers) pattern='slambed_headers\.dir' ;;
  all) pattern= ;;
  *) echo "error: alone.sh $what: not one of headers, all" >&2; exit 2 ;;
esac
build=${SLAMBED_ALONE:-build-alone}
made_here "$build" .
werror=OFF
if [ "$(c++ -dumpversion 2>/dev/null)" = 12 ]; then werror=ON; fi
cmake -S . -B "$build" -G Ninja -DSLAMBED_TESTS=ON -DSLAMBED_HEADERS=ON -DSLAMBED_WERROR=$werror -DCMAKE_BUILD_TYPE=Debug \
  -DCMAKE_CXX_FLAGS_DEBUG=-O0 >/dev/null
mapfile -t objects < <(ninja -C "$build" -t targets all | sed -n 's/^\(.*\.cpp\.o\): .*/\1/p' | grep "$pattern")

# compile LIMIT_S OBJECT ...: exit status 124 if the time was not enough.
compile() {
  timeout --signal=INT "$1" ninja -C "$build" --quiet -k 0 ${SLAMBED_NINJA_FLAGS:-} "${@:2}"
}
left_out() {
  local object count=0
  for object in "${objects[@]}"; do
    if [ ! -e "$build/$object" ]; then count=$((count + 1)); fi
  done
  echo $count
}
status=0
# Files that changed since the last commit that passed come first.
base=${SLAMBED_PASSED:-$(cat "$(git rev-parse --git-path ci-passed 2>/dev/null)" 2>/dev/null || true)}
if [ -n "$base" ] && changed=$(git diff --name-only "$base" -- systems 2>/dev/null | grep -E '\.(cpp|hpp)$'); then
  mapfile -t first < <(printf '%s\n' "${objects[@]}" | grep -F -f <(sed 's/.*/\/&/; s/.*\/\([^/]*\/[^/]*\)$/\1/' <<<"$changed") || true)
  if [ ${#first[@]} -gt 0 ]; then compile "$limit_s" "${first[@]}" || status=$?; fi
fi
[ "$status" -ne 0 ] || compile "$limit_s" "${objects[@]}" || status=$?
if [ "$status" -eq 124 ]; then
  echo "compiled alone: all but $(left_out) of ${#objects[@]}, for which there was no time; the nightly compiles all"
elif [ "$status" -ne 0 ]; then
  echo "error: what stands above does not compile by itself: an include is missing, or the file is wrong" >&2
  exit 1
else
  echo "compiled alone: ${#objects[@]}"
fi
