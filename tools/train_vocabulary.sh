#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Retrains the built-in vocabulary on generated rooms only, so that it has no third-party images.
# Needed whenever the ORB test pattern changes. Usage: tools/train_vocabulary.sh BUILD_FOLDER
set -euo pipefail
cd "$(dirname "$0")/.."
bin="${1:?usage: tools/train_vocabulary.sh BUILD_FOLDER}/bin"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

render() {  # trajectory seed seconds
  "$bin/slambed-synth" --out "$work/$1_$2" --trajectory "$1" --seed "$2" --seconds "$3" --fps 1.5
}
for seed in 201 202 203 204 205 206 207 208 209 210; do render spline "$seed" 60; done
render office 301 87
render two_laps 302 48
"$bin/slambed-vocab" train "$work"/* --branching 10 --depth 4 -o systems/core/features/data/orb_10k.slv
