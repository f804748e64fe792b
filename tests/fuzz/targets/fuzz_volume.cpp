// load_volume on any bytes.
#include <cmath>
#include <cstdlib>

#include "worker/loaders/volume.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto volume = candela::loaders::load_volume({reinterpret_cast<const char*>(data), size}, "x.vol");
  if (!volume.ok()) {
    if (volume.error().to_string().find('\n') != std::string::npos) std::abort();
    return 0;
  }
  const auto& n = volume->size;
  if (volume->values.size() != std::size_t{n[0]} * n[1] * n[2] * volume->channels) std::abort();
  for (const float v : volume->values)
    if (!std::isfinite(v)) std::abort();
  return 0;
}
