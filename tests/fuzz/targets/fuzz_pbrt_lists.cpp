// The curves and the grid of densities of pbrt directives on any bytes: what is read is finite, densities are
// not negative, and as many as the grid says.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "worker/loaders/pbrt_curve.h"
#include "worker/loaders/pbrt_grid.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace candela::loaders;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  for (const std::int64_t count : {1, 2}) {
    const auto curves = load_pbrt_curves(bytes, "x.pbrt", 0, 1, count);
    if (!curves.ok()) continue;
    if (curves->size() != static_cast<std::size_t>(count)) std::abort();
    for (const PieceList& pieces : *curves)
      for (const CubicPiece& piece : pieces)
        for (const ControlPoint& point : piece)
          if (!std::isfinite(point.p.x + point.p.y + point.p.z) || !std::isfinite(point.radius)) std::abort();
  }
  const auto grid = load_pbrt_grid(bytes, "x.pbrt", 0, 1);
  if (!grid.ok()) return 0;
  if (grid->values.size() != std::size_t{grid->size[0]} * grid->size[1] * grid->size[2]) std::abort();
  for (const float density : grid->values)
    if (!(density >= 0) || !std::isfinite(density)) std::abort();
  return 0;
}
