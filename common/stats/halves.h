// The two independent halves of an image, row by row: all that an estimate of its error reads.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "common/film/development.h"
#include "common/film/merged_film.h"

namespace candela::stats {

struct Halves {
  std::uint32_t width = 0, height = 0;
  double n0 = 0, n1 = 0;  // iterations, or segments of chains, of each
  bool chains = false;    // the halves are independent groups of chains, whose segments are not independent
  double factor_variance = 0;  // as film::Development has it
  // Rows of width * 3 values: the halves' means and the part of the pooled image that carries the factor.
  std::function<void(std::uint32_t y, std::span<double> a, std::span<double> b, std::span<double> scaled)>
      row;

  double weight0() const { return n0 / (n0 + n1); }
  double weight1() const { return n1 / (n0 + n1); }
};

// Halves of the image as developed. `film` and `development` must outlive it.
Halves halves_of(const film::MergedFilm& film, const film::Development& development);

}  // namespace candela::stats
