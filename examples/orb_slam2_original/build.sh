#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Builds ORB-SLAM2 as its authors published it, and the program by which slambed plays it.
#   examples/orb_slam2_original/build.sh SOURCE PICTURES...   SOURCE: folder, or tar archive of it; PICTURES: folders of PNG or JPEG files, from which
#                                                    a vocabulary is trained
#   VOCABULARY=ORBvoc.txt examples/orb_slam2_original/build.sh SOURCE
# Nothing of it is part of slambed: it is licensed under the GPLv3, and so is what this makes.
set -euo pipefail

die() { echo "error: $*" >&2; exit 2; }

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
[ $# -ge 1 ] || { sed -n '4,6s/^# *//p' "$0" >&2; exit 2; }
source=$1
shift
work=${BUILD:-$root/build-orb_slam2}
mkdir -p "$work" "$here/bin"

if [ ! -f "$work/source/src/Tracking.cc" ]; then
  rm -rf "$work/source"
  mkdir "$work/source"
  if [ -d "$source" ]; then
    cp -r "$source/." "$work/source"
  elif [ -f "$source" ]; then
    tar -xf "$source" -C "$work/source" --strip-components 1
  else
    die "there is no $source: git clone https://github.com/raulmur/ORB_SLAM2, and git checkout f2e6f51"
  fi
fi
echo "builds the copy in $work/source; remove that to take another"
# The one place that compilers refuse today: an allocator of another type than the map's pairs.
sed -i -E 's/std::pair<const KeyFrame\*, ?g2o::Sim3>/std::pair<KeyFrame* const, g2o::Sim3>/' "$work/source/include/LoopClosing.h"

cmake -S "$here" -B "$work/build" -G Ninja -DORB_SLAM2="$work/source" -DSLAMBED_CLIENT="$root/systems/play/client" >/dev/null
ninja -C "$work/build" --quiet
install "$work/build/orb_slam2" "$here/bin/orb_slam2"

if [ -n "${VOCABULARY:-}" ]; then
  install -m 644 "$VOCABULARY" "$here/bin/vocabulary.txt"
elif [ $# -gt 0 ]; then
  # All in one call: xargs would split many into several, and each would write the vocabulary anew.
  mapfile -d '' pictures < <(find "$@" \( -name '*.png' -o -name '*.jpg' \) -print0 | sort -z)
  [ ${#pictures[@]} -gt 0 ] || die "no PNG or JPEG file in $*"
  "$work/build/train_vocabulary" "$here/bin/vocabulary.txt" "${pictures[@]}"
elif [ ! -f "$here/bin/vocabulary.txt" ]; then
  die "no vocabulary: name folders of pictures to train one from, or VOCABULARY=ORBvoc.txt"
fi
echo "ready: $here/bin/orb_slam2, $(du -h "$here/bin/vocabulary.txt" | cut -f1) of vocabulary"
