# SPDX-License-Identifier: Apache-2.0
# The node image from static programs that this host has already compiled from the sources that the tag names.
# Used by tools/build_image.sh; without such programs docker/Dockerfile compiles them.

ARG BASE=debian:bookworm-slim
FROM $BASE
COPY slambed-node slambed-sim slambed-relay slambed-synth slambed-pace slambed-play /usr/local/bin/
# A user id without an account and a home.
USER 10001:10001
ENTRYPOINT ["slambed-node"]
