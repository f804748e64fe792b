// Places on the film as a chain's random numbers choose them: uniformly over all places that the filter lets
// matter, those a little outside of the film included.
#pragma once

#include <algorithm>
#include <cstdint>

#include "worker/estimators/options.h"
#include "worker/film/filter.h"
#include "worker/mcmc/primary_state.h"
#include "worker/scene/scene.h"
#include "worker/transport/film_position.h"

namespace candela::estimators {

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

// The ray of the eye's numbers: dimensions 0 and, if the lens is finite, 1.
struct FilmRay {
  transport::FilmPosition at;
  Ray ray;
  float weight = 1;  // of the sensor
};
inline FilmRay film_ray(const scene::Scene& scene, const FilmDomain& film, mcmc::PrimarySampler& numbers) {
  FilmRay result;
  result.at = film.at(numbers.draw_2d(0, true));
  result.ray =
      scene.camera_ray(result.at.x, result.at.y,
                       scene.reads_lens() ? numbers.draw_2d(1, true) : Vec2{0.5f, 0.5f}, result.weight);
  return result;
}

// A path from the eye, uniform over the domain, and one from the light.
inline PathCounts one_of_each(const FilmDomain& film) {
  return {1 / film.area_over_film(), 1, film.border()};
}

}  // namespace candela::estimators
