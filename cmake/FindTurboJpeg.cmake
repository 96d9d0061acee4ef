# SPDX-License-Identifier: Apache-2.0
# TurboJpeg::TurboJpeg: libjpeg-turbo's own interface (Debian: libturbojpeg0-dev). The package's CMake files refer to
# libraries of other packages, so this module searches for header and library by name.
find_path(TurboJpeg_INCLUDE_DIR turbojpeg.h)
find_library(TurboJpeg_LIBRARY turbojpeg)
# The version is part of a virtual run's key, but neither header nor library contains it.
get_filename_component(TurboJpeg_folder "${TurboJpeg_LIBRARY}" DIRECTORY)
if(EXISTS "${TurboJpeg_folder}/pkgconfig/libturbojpeg.pc")
  file(STRINGS "${TurboJpeg_folder}/pkgconfig/libturbojpeg.pc" TurboJpeg_VERSION REGEX "^Version:")
  string(REGEX REPLACE "^Version: *" "" TurboJpeg_VERSION "${TurboJpeg_VERSION}")
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(TurboJpeg REQUIRED_VARS TurboJpeg_LIBRARY TurboJpeg_INCLUDE_DIR TurboJpeg_VERSION
  REASON_FAILURE_MESSAGE "install libturbojpeg0-dev (tools/setup.sh build)")
if(TurboJpeg_FOUND AND NOT TARGET TurboJpeg::TurboJpeg)
  add_library(TurboJpeg::TurboJpeg UNKNOWN IMPORTED)
  set_target_properties(TurboJpeg::TurboJpeg PROPERTIES
    IMPORTED_LOCATION "${TurboJpeg_LIBRARY}" INTERFACE_INCLUDE_DIRECTORIES "${TurboJpeg_INCLUDE_DIR}")
endif()
