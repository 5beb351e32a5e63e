# Writes a header with the SHA-256 of a file, unless it says so already. Run as a script:
# cmake -DCODE=… -DOUTPUT=… -P RenderDigest.cmake
file(SHA256 ${CODE} digest)
set(text "// Made by cmake/RenderDigest.cmake.\n#pragma once\nnamespace woodcock {\ninline constexpr char kRenderDigest[] = \"${digest}\";\n}\n")
set(old "")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} old)
endif()
if(NOT old STREQUAL text)
  file(WRITE ${OUTPUT} "${text}")
endif()
