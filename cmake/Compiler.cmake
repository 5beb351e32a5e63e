# INTERFACE targets that every layer links: how code is compiled, and which warnings it is held to.

add_library(woodcock_options INTERFACE)
target_include_directories(woodcock_options INTERFACE ${CMAKE_SOURCE_DIR})
# One portable level and no contraction, so that one binary gives the same bits on every machine it runs on
# and every instantiation of a template rounds alike. -fno-math-errno changes no value.
# GCC 12's vectorizer of straight-line code drops the rounding of (double)(float)x where two such conversions stand side by
# side, as in DVec3(Vec3(p)); Rounding.N75_a_float_keeps_no_more_than_a_float shows it.
target_compile_options(woodcock_options INTERFACE -march=x86-64-v3 -ffp-contract=off -fno-math-errno -fno-tree-slp-vectorize)
if(WOODCOCK_SANITIZE)
  target_compile_options(woodcock_options INTERFACE -fsanitize=${WOODCOCK_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
  target_link_options(woodcock_options INTERFACE -fsanitize=${WOODCOCK_SANITIZE})
endif()

add_library(woodcock_warnings INTERFACE)
target_compile_options(woodcock_warnings INTERFACE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wcast-align -Wold-style-cast -Woverloaded-virtual)
if(WOODCOCK_WERROR)
  target_compile_options(woodcock_warnings INTERFACE -Werror)
endif()
