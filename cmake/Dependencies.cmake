# Debian 12 packages; deploy/setup.sh installs them.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(glm REQUIRED)
find_package(TBB REQUIRED)
find_package(embree 3 REQUIRED)
find_package(OpenSSL REQUIRED)
find_package(ZLIB REQUIRED)
find_package(fmt REQUIRED)
find_package(spdlog REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
# OpenImageIO's CMake package names an OpenCV include folder that Debian does not ship.
pkg_check_modules(OpenImageIO REQUIRED IMPORTED_TARGET OpenImageIO)
# Module mode gives protobuf::protoc and protobuf_generate; gRPC's package needs it found first.
find_package(Protobuf MODULE REQUIRED)
find_package(gRPC CONFIG REQUIRED)

# OpenVDB's Debian package has no CMake configuration file on the default path.
find_library(OPENVDB_LIBRARY openvdb REQUIRED)
add_library(woodcock_openvdb INTERFACE)
target_link_libraries(woodcock_openvdb INTERFACE ${OPENVDB_LIBRARY} TBB::tbb)
# NanoVDB is headers only; its files may be ZIP-compressed.
find_path(NANOVDB_INCLUDE nanovdb/NanoVDB.h REQUIRED)
add_library(woodcock_nanovdb INTERFACE)
target_compile_definitions(woodcock_nanovdb INTERFACE NANOVDB_USE_ZIP)
target_link_libraries(woodcock_nanovdb INTERFACE ZLIB::ZLIB)
target_include_directories(woodcock_nanovdb SYSTEM INTERFACE ${NANOVDB_INCLUDE})

find_path(SOCI_INCLUDE soci/soci.h REQUIRED)
find_library(SOCI_CORE soci_core REQUIRED)
find_library(SOCI_SQLITE soci_sqlite3 REQUIRED)
find_library(SQLITE3_LIBRARY sqlite3 REQUIRED)
add_library(woodcock_soci INTERFACE)
target_include_directories(woodcock_soci SYSTEM INTERFACE ${SOCI_INCLUDE})
target_link_libraries(woodcock_soci INTERFACE ${SOCI_SQLITE} ${SOCI_CORE} ${SQLITE3_LIBRARY})
if(WOODCOCK_SANITIZE MATCHES "undefined")
  # SOCI's library hides the type information that this check asks for.
  target_compile_options(woodcock_soci INTERFACE -fno-sanitize=vptr)
endif()

if(WOODCOCK_BUILD_TESTS)
  find_package(GTest REQUIRED)
  # A small EXR reader that is not ours: pictures are held to what it finds in them.
  find_package(tinyexr REQUIRED)
  include(GoogleTest)
endif()
