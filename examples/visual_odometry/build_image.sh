#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The image of the example systems: Debian's Python, and numpy and OpenCV as requirements.lock pins them.
set -euo pipefail

root=$(cd "$(dirname "$0")/../.." && pwd)
"$root/tools/base_image.sh"
context=$(mktemp -d)
trap 'rm -rf "$context"' EXIT
# Packages are fetched here: inside of a build there may be no certificates for it.
grep -A1000 -E '^(numpy|opencv-python-headless)==' "$root/requirements.lock" |
  awk '/^[a-z]/ {on = /^(numpy|opencv-python-headless)==/} on' >"$context/lock.txt"
"$root/.venv/bin/pip" download -q --no-deps --require-hashes --only-binary :all: --python-version 3.11 \
  -r "$context/lock.txt" -d "$context/wheels"
cat >"$context/Dockerfile" <<'DOCKERFILE'
FROM debian:bookworm-slim
RUN apt-get update && apt-get install -y --no-install-recommends python3 && rm -rf /var/lib/apt/lists/*
COPY site /usr/local/lib/python3.11/dist-packages
DOCKERFILE
mkdir "$context/site"
for wheel in "$context"/wheels/*.whl; do python3 -m zipfile -e "$wheel" "$context/site"; done
chmod -R a+rX "$context/site"
DOCKER_BUILDKIT=0 docker build --quiet -t slambed-example-vo "$context"
