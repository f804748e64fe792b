// Places on the film as a chain's random numbers choose them: uniformly over all places that the filter lets
// matter, those a little outside of the film included.
#pragma once

#include <algorithm>
#include <cstdint>

#include "worker/film/filter.h"
#include "worker/transport/connect.h"

namespace candela::integrators::markov {

class FilmDomain {
 public:
  FilmDomain(const film::PixelFilter& filter, std::uint32_t width, std::uint32_t height)
      : border_(std::max(0.0f, static_cast<float>(filter.radius()) - 0.5f)),
        width_(static_cast<float>(width) + 2 * border_),
        height_(static_cast<float>(height) + 2 * border_),
        pixels_(static_cast<double>(width) * height) {}

  transport::FilmPosition at(Vec2 u) const { return {u.x * width_ - border_, u.y * height_ - border_}; }
  // Pixels around the film.
  float border() const { return border_; }
  double pixels() const { return pixels_; }
  // The domain's area over the film's.
  double area_over_film() const {
    return static_cast<double>(width_) * static_cast<double>(height_) / pixels_;
  }

 private:
  float border_, width_, height_;
  double pixels_;
};

}  // namespace candela::integrators::markov
