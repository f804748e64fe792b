// Contribution of a light path to the film: its value, spread over the pixels whose filter reaches the place.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "worker/core/vec.h"
#include "worker/film/filter.h"
#include "worker/transport/film_position.h"
#include "worker/transport/letters/layer_sums.h"

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

  // Splats the parts of an eye path's or a chain's value, whose prefixes are `parts`.
  void splat_parts(LayerUnits& units, std::uint32_t offset, std::span<LabelledSum> parts, FilmPosition at,
                   std::uint64_t key) const {
    for (LabelledSum& part : parts) part.sum *= to_pixels_.x * to_pixels_.y;
    for_each_pixel({at.x * to_pixels_.x, at.y * to_pixels_.y},
                   [&](std::uint32_t x, std::uint32_t y, float f) {
                     units.gather(parts, f, film_, pixel_key(key, x, y));
                     units.write(film_, x, y, offset);
                     return true;
                   });
  }

  // From any thread. `key` names the contribution among all of the unit, and seeds the rounding. False: the
  // value was refused.
  bool splat(std::uint32_t layer, FilmPosition at, Spectrum value, std::uint64_t key,
             film::SampleCounts& sample_counts) const {
    at = {at.x * to_pixels_.x, at.y * to_pixels_.y};
    value *= to_pixels_.x * to_pixels_.y;
    return for_each_pixel(at, [&](std::uint32_t x, std::uint32_t y, float f) {
      const Spectrum share = value * f;
      // A value that is refused is refused, and counted, once.
      return film_.splat(layer, x, y, {share.r, share.g, share.b}, pixel_key(key, x, y), sample_counts,
                         signed_);
    });
  }
  // The same on the image, and on the layers of expressions by the labels of the value's path: each pixel's
  // share is rounded once.
  bool splat_labelled(const PathLetters& letters, const ChannelLabels& labels, FilmPosition at,
                      Spectrum value, std::uint64_t key, film::SampleCounts& sample_counts) const {
    at = {at.x * to_pixels_.x, at.y * to_pixels_.y};
    value *= to_pixels_.x * to_pixels_.y;
    return for_each_pixel(at, [&](std::uint32_t x, std::uint32_t y, float f) {
      const Spectrum share = value * f;
      const std::uint64_t own_key = pixel_key(key, x, y);
      if (!film_.splat(0, x, y, {share.r, share.g, share.b}, own_key, sample_counts, signed_)) return false;
      const auto units = film_.units({share.r, share.g, share.b}, film::dither_word(own_key));
      transport::splat_labelled(letters, labels, units, film_, x, y);
      return true;
    });
  }

 private:
  static std::uint64_t pixel_key(std::uint64_t key, std::uint32_t x, std::uint32_t y) {
    return rng::combine(key, (std::uint64_t{y} << 32) | x);
  }
  // visit(x, y, filter) of the pixels i on the film with |at - (i + 1/2)| <= radius, until one returns false.
  template <class Visit>
  [[gnu::always_inline]] bool for_each_pixel(FilmPosition at, const Visit& visit) const {
    const float x0 = std::max(0.0f, std::ceil(at.x - radius_ - 0.5f));
    const float x1 = std::min(width_ - 1, std::floor(at.x + radius_ - 0.5f));
    const float y0 = std::max(0.0f, std::ceil(at.y - radius_ - 0.5f));
    const float y1 = std::min(height_ - 1, std::floor(at.y + radius_ - 0.5f));
    for (float y = y0; y <= y1; ++y) {
      for (float x = x0; x <= x1; ++x) {
        const float f = filter_.eval(at.x - (x + 0.5f), at.y - (y + 0.5f));
        if (f == 0) continue;
        if (!visit(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), f)) return false;
      }
    }
    return true;
  }

  const film::PixelFilter& filter_;
  film::UnitFilm& film_;
  float width_, height_, radius_;
  bool signed_;
  Vec2 to_pixels_;
};

}  // namespace candela::transport
