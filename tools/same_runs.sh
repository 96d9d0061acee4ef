#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# same_runs.sh BIN_A BIN_B EXPERIMENT [OPTION ...]: plays an experiment in virtual time with the programs of two folders, for
# example of two architectures, and compares every trajectory and every table (events, samples, link). The options are those of
# `slambed run`. Prepared sequences and masks of networks are shared; features and prior maps are made by each side's programs.
# summary.json is not compared, because kinds of processors differ in the last digits of accuracies. Exit status 1: files
# differ; their names are printed.
set -euo pipefail

a=$(realpath "$1") b=$(realpath "$2") name=$3
shift 3
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

shared=${SLAMBED_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/slambed}

play() {
  mkdir -p "$work/$1-cache"
  for folder in prepared masks data networks verified; do
    mkdir -p "$shared/$folder"
    ln -s "$(realpath "$shared/$folder")" "$work/$1-cache/$folder"
  done
  SLAMBED_CACHE=$work/$1-cache SLAMBED_BIN=$2 "$root/.venv/bin/slambed" run "$name" --engine virtual --results "$work/$1" --no-figures --jobs 2 "${@:3}" \
    >"$work/$1.log" 2>&1 || { tail -n 20 "$work/$1.log" >&2; echo "error: $name with $2" >&2; exit 1; }
  # A run's folder is named by its key, which may name the machine; its cell and seed are the same.
  for manifest in "$work/$1/$(basename "$name" .yaml)"/runs/*/manifest.json; do
    folder=$(dirname "$manifest")
    run=$(python3 -c 'import json, sys; m = json.load(open(sys.argv[1])); print(m["cell"], m["seed"])' "$manifest")
    (cd "$folder" && find . -type f \( -name '*.parquet' -o -name 'trajectory*.txt' \) -exec sha256sum {} + | sed "s|  \./|  $run |")
  done | sort -k2 >"$work/$1.sums"
}
play a "$a" "$@"
play b "$b" "$@"
files=$(wc -l <"$work/a.sums")
[ "$files" -gt 0 ] || { echo "error: no run of $name measured anything" >&2; exit 1; }
if different=$(diff "$work/a.sums" "$work/b.sums"); then
  echo "$name: same bytes, $files files"
else
  sed -n 's/^[<>] [0-9a-f]*  /differs: /p' <<<"$different" | sort -u
  echo "$name: different bytes, of $files files" >&2
  exit 1
fi
