# SPDX-License-Identifier: Apache-2.0
# One helper per kind of target, so that all libraries, tests and programs are built with the same flags.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

add_library(slambed_flags INTERFACE)
# Without contraction into FMA and without -march, the same source gives the same bytes on every machine.
# Hot integer kernels choose their instruction set at run time instead (target_clones).
target_compile_options(slambed_flags INTERFACE -Wall -Wextra -Wshadow -ffp-contract=off)
# With its vector kernels Eigen adds in another order on each architecture, and fuses on arm64 whatever the flags say. Runs take
# as long without them (docs/logbook/2026-11-26-same-bytes-on-arm64.md).
target_compile_definitions(slambed_flags INTERFACE EIGEN_DONT_VECTORIZE)
if(SLAMBED_WERROR)
  target_compile_options(slambed_flags INTERFACE -Werror)
endif()
target_include_directories(slambed_flags INTERFACE ${PROJECT_SOURCE_DIR}/systems/core)
foreach(sanitizer IN LISTS SLAMBED_SANITIZE)
  target_compile_options(slambed_flags INTERFACE -fsanitize=${sanitizer} -fno-omit-frame-pointer -g1)
  target_link_options(slambed_flags INTERFACE -fsanitize=${sanitizer})
endforeach()
if(SLAMBED_SANITIZE)
  # A finding of ASan or UBSan aborts the program; one of TSan sets its exit status. So no test passes with a finding.
  target_compile_options(slambed_flags INTERFACE -fno-sanitize-recover=all)
endif()
if(SLAMBED_FUZZ)
  target_compile_options(slambed_flags INTERFACE
    -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all -g1)
  target_link_options(slambed_flags INTERFACE -fsanitize=address,undefined)
  add_custom_target(fuzz_targets)
endif()

# slambed_unity(target): compiles eight sources as one, so that their headers are parsed once. A full build takes
# half the time, a rebuild after a change of one file takes longer. CMake's own UNITY_BUILD includes the sources by
# absolute path, so ccache would miss in another clone.
function(slambed_unity target)
  if(SLAMBED_UNITY)
    # Deferred to the end of this folder's CMakeLists.txt, which may exclude sources with their own flags
    # (SLAMBED_ALONE).
    cmake_language(EVAL CODE "cmake_language(DEFER CALL slambed_compile_together ${target})")
  endif()
endfunction()

function(slambed_compile_together target)
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/${target}_together)
  get_target_property(sources ${target} SOURCES)
  set(compiled)
  set(count 0)
  foreach(source IN LISTS sources)
    get_source_file_property(alone ${source} SLAMBED_ALONE)
    if(alone)
      list(APPEND compiled ${source})
    else()
      math(EXPR file "${count} / 8")
      math(EXPR count "${count} + 1")
      get_filename_component(whole ${source} ABSOLUTE)
      file(RELATIVE_PATH path ${folder} ${whole})
      string(APPEND includes_${file} "#include \"${path}\"\n")
      if(NOT ${folder}/${file}.cpp IN_LIST compiled)
        list(APPEND compiled ${folder}/${file}.cpp)
      endif()
    endif()
  endforeach()
  foreach(file RANGE ${count})
    if(DEFINED includes_${file})
      file(CONFIGURE OUTPUT ${folder}/${file}.cpp CONTENT "${includes_${file}}")
    endif()
  endforeach()
  set_target_properties(${target} PROPERTIES SOURCES "${compiled}")
  # GCC takes the included sources for headers, and warns of classes with members of file-local types.
  target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
endfunction()

# slambed_library(name SOURCES a.cpp ... DEPENDS slambed_base ...): the library slambed_<name>, a layer.
# It may depend only on libraries defined before it, so there are no cycles.
function(slambed_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  set(target slambed_${name})
  if(ARG_SOURCES)
    add_library(${target} STATIC ${ARG_SOURCES})
    set_property(GLOBAL APPEND PROPERTY SLAMBED_LIBRARIES ${target})
    target_link_libraries(${target} PUBLIC slambed_flags ${ARG_DEPENDS})
    slambed_unity(${target})
  else()
    add_library(${target} INTERFACE)
    target_link_libraries(${target} INTERFACE slambed_flags ${ARG_DEPENDS})
  endif()
  foreach(dependency IN LISTS ARG_DEPENDS)
    if(dependency MATCHES "^slambed_" AND NOT TARGET ${dependency})
      message(FATAL_ERROR "${target} depends on ${dependency}, which is not below it")
    endif()
  endforeach()
endfunction()

# slambed_program(name SOURCES ... DEPENDS ...): a program that runs in nodes and is part of the image.
function(slambed_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} CLI11::CLI11)
  if(SLAMBED_STATIC)
    target_link_options(${name} PRIVATE -static)
  endif()
endfunction()

# slambed_tool(name SOURCES ... DEPENDS ...): a program for interactive use, not part of the image.
function(slambed_tool name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} CLI11::CLI11)
endfunction()

# slambed_systems_in_order(result name ...): returns the system folders with a CMakeLists.txt, each after the systems
# in the DEPENDS of its slambed_library.
function(slambed_systems_in_order result)
  set(waiting)
  foreach(name IN LISTS ARGN)
    if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${name}/CMakeLists.txt)
      list(APPEND waiting ${name})
      file(READ ${CMAKE_CURRENT_SOURCE_DIR}/${name}/CMakeLists.txt text)
      string(REGEX MATCH "slambed_library\\([^)]*\\)" library "${text}")
      string(REGEX MATCHALL "slambed_[a-z0-9_]+" used_by_${name} "${library}")
    endif()
  endforeach()
  set(ordered)
  while(waiting)
    set(left)
    foreach(name IN LISTS waiting)
      set(ready ON)
      foreach(other IN LISTS waiting)
        if(NOT other STREQUAL name AND slambed_${other} IN_LIST used_by_${name})
          set(ready OFF)
        endif()
      endforeach()
      if(ready)
        list(APPEND ordered ${name})
      else()
        list(APPEND left ${name})
      endif()
    endforeach()
    if(left STREQUAL waiting)
      message(FATAL_ERROR "systems that depend on each other in a circle: ${left}")
    endif()
    set(waiting ${left})
  endwhile()
  set(${result} ${ordered} PARENT_SCOPE)
endfunction()

# slambed_test(name [LIVE] SOURCES ... DEPENDS ...): one GoogleTest program with one ctest entry per test case.
# LIVE: its cases depend on real time, or start programs that do. They run one at a time (label `live`), and the
# program is one ctest entry, so that its cases share their sequences.
function(slambed_test name)
  if(NOT SLAMBED_TESTS)
    return()
  endif()
  cmake_parse_arguments(ARG "LIVE" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} GTest::gtest GTest::gtest_main)
  # Test code runs only briefly, so compiling it with -O3 would cost more than it saves.
  if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
    target_compile_options(${name} PRIVATE -O1)
  endif()
  slambed_unity(${name})
  if(ARG_LIVE)
    add_test(NAME ${name} COMMAND ${name} --gtest_brief=1)
    set_tests_properties(${name} PROPERTIES TIMEOUT 900 RUN_SERIAL ON LABELS live)
    return()
  endif()
  include(GoogleTest)
  # An emulated processor is ten times slower.
  set(limit_s 300)
  if(CMAKE_CROSSCOMPILING)
    set(limit_s 3000)
  endif()
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT ${limit_s})
endfunction()

# slambed_vector_kernels(prefix): sets the flags of prefix_avx2.cpp and prefix_avx512.cpp in this folder. GCC takes
# the instruction set from a pragma in the file, but Clang needs options.
function(slambed_vector_kernels prefix)
  set_source_files_properties(${prefix}_portable.cpp ${prefix}_avx2.cpp ${prefix}_avx512.cpp
    PROPERTIES SLAMBED_ALONE ON)
  if(CMAKE_CXX_COMPILER_ID MATCHES Clang AND CMAKE_SYSTEM_PROCESSOR STREQUAL x86_64)
    set_source_files_properties(${prefix}_avx2.cpp PROPERTIES COMPILE_OPTIONS -mavx2)
    set_source_files_properties(${prefix}_avx512.cpp PROPERTIES COMPILE_OPTIONS
      "-mavx512f;-mavx512bw;-mavx512dq;-mavx512vl;-mavx512vpopcntdq")
  endif()
endfunction()

# slambed_fixed_eigen_blocks(target): fixes the block sizes of Eigen's large products to its defaults for x86-64.
# Otherwise they depend on the caches of the processor, and so does the order of additions.
function(slambed_fixed_eigen_blocks target)
  target_compile_definitions(${target} PRIVATE EIGEN_NO_CPUID
    EIGEN_DEFAULT_L1_CACHE_SIZE=32768 EIGEN_DEFAULT_L2_CACHE_SIZE=262144
    EIGEN_DEFAULT_L3_CACHE_SIZE=2097152)
endfunction()

# slambed_test_on_an_older_processor(name): runs the test cases SameBits.* of a test program again, with the functions
# that glibc chooses for an x86-64 processor without FMA and AVX2.
function(slambed_test_on_an_older_processor name)
  if(NOT SLAMBED_TESTS OR NOT CMAKE_SYSTEM_PROCESSOR STREQUAL x86_64)
    return()
  endif()
  add_test(NAME ${name}_on_an_older_processor COMMAND ${name} --gtest_filter=SameBits.*)
  set_tests_properties(${name}_on_an_older_processor PROPERTIES
    ENVIRONMENT GLIBC_TUNABLES=glibc.cpu.hwcaps=-FMA,-AVX2
    FAIL_REGULAR_EXPRESSION "Running 0 tests")
endfunction()

# Adds the test that no library's results depend on the processor: it reads the object code, of x86-64 only. Call it after all
# slambed_library() calls.
function(slambed_same_bytes_test)
  if(NOT SLAMBED_TESTS OR NOT CMAKE_SYSTEM_PROCESSOR STREQUAL x86_64)
    return()
  endif()
  get_property(libraries GLOBAL PROPERTY SLAMBED_LIBRARIES)
  list(TRANSFORM libraries REPLACE "(.+)" "$<TARGET_FILE:\\1>" OUTPUT_VARIABLE files)
  add_test(NAME NoFloorHangsOnItsProcessor
    COMMAND ${PROJECT_SOURCE_DIR}/tools/same_bytes_symbols.sh ${files})
endfunction()

# Adds the target slambed_headers, which compiles every header by itself, because a missing include in a header shows
# only where the header is included first. Call it after all slambed_library() calls.
function(slambed_headers_alone)
  if(NOT SLAMBED_HEADERS)
    return()
  endif()
  file(GLOB_RECURSE headers RELATIVE ${PROJECT_SOURCE_DIR} CONFIGURE_DEPENDS
    systems/*.hpp systems/*.h)
  set(sources)
  foreach(header IN LISTS headers)
    set(source ${PROJECT_BINARY_DIR}/headers/${header}.cpp)
    get_filename_component(folder ${source} DIRECTORY)
    file(RELATIVE_PATH path ${folder} ${PROJECT_SOURCE_DIR}/${header})
    file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${path}\"\n")
    list(APPEND sources ${source})
  endforeach()
  get_property(libraries GLOBAL PROPERTY SLAMBED_LIBRARIES)
  add_library(slambed_headers OBJECT EXCLUDE_FROM_ALL ${sources})
  target_link_libraries(slambed_headers PRIVATE ${libraries} GTest::gtest ${OpenCV_LIBS} Ceres::ceres)
  # Headers of tests use these macros, which their programs get by compile definitions.
  target_compile_definitions(slambed_headers PRIVATE SLAMBED_NODE="" SLAMBED_DEVICES="")
endfunction()

# slambed_fuzzer(name SOURCES ... DEPENDS ...): a libFuzzer program, part of the target fuzz_targets.
function(slambed_fuzzer name)
  if(NOT SLAMBED_FUZZ)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS})
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  add_dependencies(fuzz_targets ${name})
endfunction()

# slambed_decoder_fuzzers(prefix TARGETS source DEPENDS ... DECODERS ...): one libFuzzer program per decoder in
# fuzzed_targets() of the source (core/wire/fuzz).
function(slambed_decoder_fuzzers prefix)
  if(NOT SLAMBED_FUZZ)
    return()
  endif()
  cmake_parse_arguments(ARG "" "TARGETS" "DEPENDS;DECODERS" ${ARGN})
  set(shared ${PROJECT_SOURCE_DIR}/systems/core/wire/fuzz)
  add_library(${prefix}_decoder_fuzz OBJECT ${shared}/decoder_fuzz.cpp ${ARG_TARGETS})
  target_link_libraries(${prefix}_decoder_fuzz PRIVATE ${ARG_DEPENDS})
  foreach(decoder ${ARG_DECODERS})
    slambed_fuzzer(${prefix}_${decoder}_fuzz
      SOURCES ${shared}/decoder_name.cpp $<TARGET_OBJECTS:${prefix}_decoder_fuzz>
      DEPENDS ${ARG_DEPENDS})
    target_compile_definitions(${prefix}_${decoder}_fuzz PRIVATE SLAMBED_DECODER="${decoder}")
  endforeach()
endfunction()

function(slambed_benchmark name)
  if(NOT SLAMBED_BENCHMARKS)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} benchmark::benchmark benchmark::benchmark_main)
endfunction()
