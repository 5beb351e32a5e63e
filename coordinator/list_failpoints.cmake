# Writes OUTPUT, a header with the names that stand in calls of `failpoint` in SOURCES. A name stands in one place, so that a test that
# kills the program there knows where.
cmake_policy(VERSION 3.25)
set(names "")
foreach(source IN LISTS SOURCES)
  file(READ ${source} text)
  string(REGEX MATCHALL "failpoint\\(\"[^\"]*\"\\)" calls "${text}")
  foreach(call IN LISTS calls)
    string(REGEX REPLACE "failpoint\\(\"([^\"]*)\"\\)" "\\1" name "${call}")
    if(name IN_LIST names)
      message(FATAL_ERROR "${source}: the failpoint \"${name}\" has its name from another place already; give it one of its own")
    endif()
    list(APPEND names ${name})
  endforeach()
endforeach()
if(NOT names)
  message(FATAL_ERROR "no failpoint in ${SOURCES}")
endif()
list(SORT names)
list(LENGTH names count)
list(JOIN names "\", \"" names)
file(WRITE ${OUTPUT} "// Made by list_failpoints.cmake.
#pragma once

#include <array>

inline constexpr std::array<const char*, ${count}> kFailpointNames{\"${names}\"};
")
