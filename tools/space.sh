#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# space.sh MB WHAT: exits with 3 if there is not enough free disk space for WHAT.
set -euo pipefail

needed_mb=$1
what=$2
root=$(cd "$(dirname "$0")/.." && pwd)
for folder in "$root" "${TMPDIR:-/tmp}"; do
  free_mb=$(df -Pm "$folder" | awk 'NR == 2 {print $4}')
  if [ "$free_mb" -lt "$needed_mb" ]; then
    echo "error: $what needs $needed_mb MB, but $folder has $free_mb MB free;" \
      "free some space (make clean, docker system prune) or set TMPDIR" >&2
    exit 3
  fi
done
