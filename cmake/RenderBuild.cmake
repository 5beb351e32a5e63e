# The identity of a render build: the SHA-256 of the machine code that the frame renderer is linked of.
#
# The linker itself says what belongs to it: a relocatable link of the frame layer's objects takes from the archives of the layers
# below those members that are needed, and no others. Compile options, the compiler, and libraries of headers count by what they
# make of the code. Comments, reports, tests and the folder of the build do not reach it.

# woodcock_archives_below(out target): the static libraries of this project that the target links, itself left out, nearest first.
function(woodcock_archives_below out target)
  set(found "")
  set(waiting ${target})
  set(seen "")
  while(waiting)
    list(POP_FRONT waiting next)
    if(next IN_LIST seen)
      continue()
    endif()
    list(APPEND seen ${next})
    get_target_property(type ${next} TYPE)
    get_target_property(imported ${next} IMPORTED)
    if(imported)
      continue()
    endif()
    if(type STREQUAL "STATIC_LIBRARY" AND NOT next STREQUAL target)
      list(APPEND found ${next})
    endif()
    foreach(property LINK_LIBRARIES INTERFACE_LINK_LIBRARIES)
      get_target_property(links ${next} ${property})
      foreach(link IN LISTS links)
        string(REGEX REPLACE "^\\$<LINK_ONLY:(.*)>$" "\\1" link "${link}")
        if(TARGET "${link}")
          list(APPEND waiting ${link})
        endif()
      endforeach()
    endforeach()
  endwhile()
  set(${out} ${found} PARENT_SCOPE)
endfunction()

# woodcock_render_digest(target header): makes the header, with `kRenderDigest`, of the target's objects and what they link. The
# header is written only when the digest changes, so nothing is compiled again for it otherwise.
function(woodcock_render_digest target header)
  woodcock_archives_below(below ${target})
  set(archives "")
  foreach(archive IN LISTS below)
    list(APPEND archives $<TARGET_FILE:${archive}>)
  endforeach()
  set(code ${CMAKE_CURRENT_BINARY_DIR}/render_code.o)
  # Debug information names folders; the build's identity does not depend on them.
  add_custom_command(
    OUTPUT ${header}
    BYPRODUCTS ${code}
    COMMAND ${CMAKE_CXX_COMPILER} -r -nostdlib -Wl,--strip-debug -o ${code} $<TARGET_OBJECTS:${target}> -Wl,--start-group ${archives} -Wl,--end-group
    COMMAND ${CMAKE_COMMAND} -DCODE=${code} -DOUTPUT=${header} -P ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/RenderDigest.cmake
    DEPENDS $<TARGET_OBJECTS:${target}> ${archives} ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/RenderDigest.cmake
    COMMENT "Digest of the code that renders"
    COMMAND_EXPAND_LISTS VERBATIM)
endfunction()
