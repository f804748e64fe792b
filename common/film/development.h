// Turns a film's layers into the image. One layer is the image of most jobs; a job of Markov chains adds two,
// the first with a factor that is known when the image is read (law 4). Whoever develops an image, or its
// error, asks here.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/film/layout.h"
#include "common/film/merged_film.h"

namespace candela::film {

// The image is factor * mean of layer 0 and its corrections, and with two layers + mean of layer 1.
struct Development {
  double factor = 1;
  bool two_layers = false;
  double factor_variance = 0;  // relative: (standard error / factor)^2
  // By half: what is added to the sums of layer 0, in units of light, before they are divided by the number
  // of iterations: width * height * 3 values, or none.
  std::array<std::shared_ptr<const std::vector<float>>, 2> corrections = {};
  // Layers that are combined into the image, and no layers of their own.
  std::uint32_t image_layers() const { return two_layers ? 2 : 1; }
};

// Preconditions: the film has those layers; `out` and `scratch` have width * 3 values. `scaled` gets what of
// the image carries the factor (the same numbers as `out` with one layer).
void develop_image_row(const MergedFilm& film, const Development& development, std::uint32_t y,
                       MergedFilm::Which which, std::span<double> out, std::span<double> scaled);

// width * height * 3 floats, row by row.
std::vector<float> develop_image(const MergedFilm& film, const Development& development,
                                 MergedFilm::Which which = MergedFilm::Which::both);

}  // namespace candela::film
