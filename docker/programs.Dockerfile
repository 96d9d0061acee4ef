# SPDX-License-Identifier: Apache-2.0
# The node image out of programs that this host has already compiled, statically, of the very sources that the tag
# names. Used by tools/build_image.sh; where there are none, docker/Dockerfile compiles them.

FROM debian:bookworm-slim
COPY slambed-node slambed-sim slambed-relay slambed-synth slambed-pace slambed-play /usr/local/bin/
# No account, no home: a number that owns nothing.
USER 10001:10001
ENTRYPOINT ["slambed-node"]
