// load_ply on any bytes.
#include "mesh_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  check_mesh(candela::loaders::load_ply({reinterpret_cast<const char*>(data), size}, "x.ply"));
  return 0;
}
