// What a light path adds to the film: its value spread over the pixels whose filter reaches the place.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "worker/core/vec.h"
#include "worker/film/filter.h"
#include "worker/transport/film_position.h"

namespace candela::transport {

class Splatter {
 public:
  // camera_units: see UnitContext.
  Splatter(const film::PixelFilter& filter, film::UnitFilm& film, std::uint32_t width, std::uint32_t height,
           Vec2 camera_units = {1, 1})
      : filter_(filter),
        film_(film),
        width_(static_cast<float>(width)),
        height_(static_cast<float>(height)),
        radius_(static_cast<float>(filter.radius())),
        signed_(filter.has_negative_lobes()),
        to_pixels_{1 / camera_units.x, 1 / camera_units.y} {}

  // From any thread. `key` names the contribution among all of the unit, and seeds the rounding. False: the
  // value was refused.
  bool splat(std::uint32_t layer, FilmPosition at, Spectrum value, std::uint64_t key,
             film::Tallies& tallies) const {
    at = {at.x * to_pixels_.x, at.y * to_pixels_.y};
    value *= to_pixels_.x * to_pixels_.y;
    // Pixels i with |at - (i + 1/2)| <= radius, on the film.
    const float x0 = std::max(0.0f, std::ceil(at.x - radius_ - 0.5f));
    const float x1 = std::min(width_ - 1, std::floor(at.x + radius_ - 0.5f));
    const float y0 = std::max(0.0f, std::ceil(at.y - radius_ - 0.5f));
    const float y1 = std::min(height_ - 1, std::floor(at.y + radius_ - 0.5f));
    for (float y = y0; y <= y1; ++y) {
      for (float x = x0; x <= x1; ++x) {
        const float f = filter_.eval(at.x - (x + 0.5f), at.y - (y + 0.5f));
        if (f == 0) continue;
        const auto px = static_cast<std::uint32_t>(x), py = static_cast<std::uint32_t>(y);
        const Spectrum share = value * f;
        // A value that is refused is refused, and counted, once.
        if (!film_.splat(layer, px, py, {share.r, share.g, share.b},
                         rng::combine(key, (std::uint64_t{py} << 32) | px), tallies, signed_))
          return false;
      }
    }
    return true;
  }

 private:
  const film::PixelFilter& filter_;
  film::UnitFilm& film_;
  float width_, height_, radius_;
  bool signed_;
  Vec2 to_pixels_;
};

}  // namespace candela::transport
