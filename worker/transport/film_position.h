#pragma once

#include <algorithm>
#include <cstdint>

namespace candela::transport {

// A place on the film, in pixels; (0, 0) is the top left corner.
struct FilmPosition {
  float x = 0, y = 0;
};

struct Pixel {
  std::uint32_t x = 0, y = 0;
};

// The pixel that a place is in; of a place beside the film, the nearest pixel.
inline Pixel pixel_of(FilmPosition at, std::uint32_t width, std::uint32_t height) {
  return {static_cast<std::uint32_t>(std::clamp(at.x, 0.0f, static_cast<float>(width - 1))),
          static_cast<std::uint32_t>(std::clamp(at.y, 0.0f, static_cast<float>(height - 1)))};
}

}  // namespace candela::transport
