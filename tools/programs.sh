# SPDX-License-Identifier: Apache-2.0
# Sourced by scripts that build: names of the C++ programs, and checks of the programs in $bin.
programs="slambed-node slambed-sim slambed-relay slambed-synth slambed-pace slambed-play"

# programs_are_of HASH: true if all programs exist and their stamp is this hash of the sources.
programs_are_of() {
  local program
  [ "$(cat "$bin/sources.sha256" 2>/dev/null)" = "$1" ] || return 1
  for program in $programs; do [ -x "$bin/$program" ] || return 1; done
}

# programs_are_static: true if the programs need no shared libraries.
programs_are_static() {
  local program
  for program in $programs; do
    if ldd "$bin/$program" >/dev/null 2>&1; then return 1; fi
  done
}
