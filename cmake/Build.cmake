# How a layer is declared.

# woodcock_layer(name SOURCES a.cpp … LINKS target …): a static library, or an INTERFACE one without sources.
function(woodcock_layer name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  if(ARG_SOURCES)
    add_library(${name} STATIC ${ARG_SOURCES})
    target_link_libraries(${name} PUBLIC woodcock_options ${ARG_LINKS} PRIVATE woodcock_warnings ${ARG_PRIVATE_LINKS})
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  else()
    add_library(${name} INTERFACE)
    target_link_libraries(${name} INTERFACE woodcock_options ${ARG_LINKS})
  endif()
endfunction()

# woodcock_test(name SOURCES a.cpp … LINKS target …): a GoogleTest program whose tests ctest lists one by one.
# LABELS: "long" keeps it out of the default run; its tests are called long.NAME, since ctest takes properties by name and would take
# the short form of a test that has both out of the default run too. TIMEOUT in seconds, for each test (default 300).
function(woodcock_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT;LABELS" "SOURCES;LINKS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE woodcock_options woodcock_warnings GTest::gtest GTest::gmock GTest::gtest_main ${ARG_LINKS})
  if(WOODCOCK_SANITIZE)
    # Half of a sanitized build is the optimiser at work on tests, which spend their time in the libraries.
    target_compile_options(${name} PRIVATE -O0)
  endif()
  target_compile_definitions(${name} PRIVATE WOODCOCK_SOURCE_DIR="${CMAKE_SOURCE_DIR}" WOODCOCK_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}")
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  if(ARG_LABELS)
    gtest_discover_tests(${name} TEST_PREFIX "${ARG_LABELS}." DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS ${ARG_LABELS})
  else()
    gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT ${ARG_TIMEOUT})
  endif()
endfunction()
