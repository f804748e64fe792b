cmake_minimum_required(VERSION 3.25)
# Writes the version header when the source tree's identity has changed. The identity is the hash of every source
# that can change a pixel or the wire format, so that a commit to the docs does not split a farm.
file(GLOB_RECURSE sources RELATIVE ${SOURCE} ${SOURCE}/common/*.cpp ${SOURCE}/common/*.h ${SOURCE}/worker/*.cpp
     ${SOURCE}/worker/*.h ${SOURCE}/proto/*.proto ${SOURCE}/CMakeLists.txt)
list(SORT sources)
set(digests "${ARCH}")
foreach(source ${sources})
  file(SHA256 ${SOURCE}/${source} digest)
  string(APPEND digests "${source}:${digest}\n")
endforeach()
string(SHA256 build "${digests}")
string(SUBSTRING ${build} 0 16 build)
file(CONFIGURE OUTPUT ${OUT} CONTENT "// Made by version.cmake.
#pragma once
#define CANDELA_VERSION \"${VERSION}\"
#define CANDELA_BUILD_ID \"${VERSION}-${build}\"
#define CANDELA_ARCH \"${ARCH}\"
" @ONLY)
