# ccache where present. Precompiled headers need the sloppiness named here to be cached at all.
find_program(WOODCOCK_CCACHE ccache)
if(WOODCOCK_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER
      ${WOODCOCK_CCACHE} sloppiness=pch_defines,time_macros,include_file_ctime,include_file_mtime base_dir=${CMAKE_SOURCE_DIR} hash_dir=false)
endif()
