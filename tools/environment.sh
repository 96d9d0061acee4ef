# SPDX-License-Identifier: Apache-2.0
# Sourced by scripts that build. Removes other software's variables (a sourced ROS, an activated conda) from the
# environment, so that only packages of the system are used. One line lists what was removed.

# leave_out NAME ...: unsets these variables and notes those that were set.
leave_out() {
  local name
  for name in "$@"; do
    if [ -n "${!name:-}" ]; then left_out+=" $name"; fi
    unset "$name"
  done
}

left_out=
# Search paths of Python packages, headers, libraries and CMake packages.
leave_out PYTHONHOME PYTHONPATH CPATH C_INCLUDE_PATH CPLUS_INCLUDE_PATH LIBRARY_PATH GCC_EXEC_PREFIX COMPILER_PATH \
  CMAKE_PREFIX_PATH CMAKE_INCLUDE_PATH CMAKE_LIBRARY_PATH CMAKE_PROGRAM_PATH CMAKE_TOOLCHAIN_FILE CMAKE_ARGS PKG_CONFIG_PATH
if [ -n "${CONDA_PREFIX:-}" ]; then
  # conda's compilers have their own flags and link conda's C library.
  leave_out CC CXX CFLAGS CXXFLAGS CPPFLAGS LDFLAGS
  export PATH=":$PATH:"
  PATH=${PATH//":$CONDA_PREFIX/bin:"/:}
  PATH=${PATH#:} PATH=${PATH%:}
  left_out+=" $CONDA_PREFIX/bin"
fi
[ -z "$left_out" ] || echo "left out of the build, other software's:$left_out"

# give_to_caller PATH ...: under sudo, gives the paths to the calling user if the parent folder belongs to that user.
give_to_caller() {
  local path
  if [ "$(id -u)" -ne 0 ] || [ -z "${SUDO_UID:-}" ]; then return 0; fi
  for path in "$@"; do
    if [ -e "$path" ] && [ "$(stat -c %u "$(dirname "$path")")" = "$SUDO_UID" ]; then
      chown -hR "$SUDO_UID:${SUDO_GID:-$SUDO_UID}" "$path"
    fi
  done
}

# own_compiler: prints the compiler and flags that the user has set; nothing for the system's compiler without flags.
own_compiler() {
  local name
  for name in CC CXX CFLAGS CXXFLAGS CPPFLAGS LDFLAGS; do
    if [ -n "${!name:-}" ]; then echo -n "$name=${!name} "; fi
  done
}

# made_here FOLDER ROOT: removes a build folder that was moved or belongs to other sources, because it would silently
# compile those.
made_here() {
  local cache=$1/CMakeCache.txt made sources
  [ -e "$cache" ] || return 0
  made=$(sed -n 's/^CMAKE_CACHEFILE_DIR:INTERNAL=//p' "$cache")
  sources=$(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' "$cache")
  if [ "$(realpath -m "$made")" = "$(realpath "$1")" ] && [ "$(realpath -m "$sources")" = "$(realpath "$2")" ]; then return 0; fi
  echo "making $(basename "$1") again: it was made in $made, of $sources"
  rm -rf "${1:?}"
}
