# ccache where present. Precompiled headers need the sloppiness named here to be cached at all. The settings go
# through the environment: settings on ccache's command line need version 4.8.
find_program(WOODCOCK_CCACHE ccache)
if(WOODCOCK_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER
      ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_ctime,include_file_mtime CCACHE_BASEDIR=${CMAKE_SOURCE_DIR}
      CCACHE_NOHASHDIR=1 ${WOODCOCK_CCACHE})
endif()
