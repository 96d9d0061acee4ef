# SPDX-License-Identifier: Apache-2.0
# Sourced by the scripts that build: what the C++ programs are, and of which sources those in $bin were made.
programs="slambed-node slambed-sim slambed-relay slambed-synth slambed-pace slambed-play"

# programs_are_of HASH: all of them are there, and the stamp beside them says so.
programs_are_of() {
  local program
  [ "$(cat "$bin/sources.sha256" 2>/dev/null)" = "$1" ] || return 1
  for program in $programs; do [ -x "$bin/$program" ] || return 1; done
}

# True when they run without this host's libraries.
programs_are_static() {
  local program
  for program in $programs; do
    if ldd "$bin/$program" >/dev/null 2>&1; then return 1; fi
  done
}
