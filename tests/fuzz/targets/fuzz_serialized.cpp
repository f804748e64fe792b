// load_serialized on any bytes. A first byte below 128: the rest is the file. Else the rest is what a mesh's
// zlib stream holds, and the file is made around it here, for no mutation gets through compression; its
// lowest bits choose version 3 or 4 and how many times the stream is in the file.
#include <zlib.h>

#include <vector>

#include "mesh_check.h"

namespace {

void put(std::string& out, std::uint64_t value, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i) out.push_back(static_cast<char>(value >> (8 * i)));
}

std::string wrap(std::uint8_t choice, const std::uint8_t* data, std::size_t size) {
  uLongf length = compressBound(size);
  std::vector<Bytef> stream(length);
  compress2(stream.data(), &length, data, size, 1);
  const std::size_t version = (choice & 1) != 0 ? 3 : 4;
  const std::size_t meshes = 1 + (choice >> 1 & 1);
  std::string file;
  std::vector<std::size_t> offsets;
  for (std::size_t i = 0; i < meshes; ++i) {
    offsets.push_back(file.size());
    put(file, 0x041c, 2);
    put(file, version, 2);
    file.append(reinterpret_cast<const char*>(stream.data()), length);
  }
  for (const std::size_t offset : offsets) put(file, offset, version == 3 ? 4 : 8);
  put(file, meshes, 4);
  return file;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::string file = data[0] < 128 ? std::string(reinterpret_cast<const char*>(data) + 1, size - 1)
                                         : wrap(data[0], data + 1, size - 1);
  check_mesh(candela::loaders::load_serialized(file, "x.serialized", data[0] >> 2 & 1));
  return 0;
}
