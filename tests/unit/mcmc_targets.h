// Small targets for tests of chains: known functions of a few primary samples, that put what they are worth
// at a place on the film.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "worker/mcmc/chain.h"
#include "worker/mcmc/primary_space.h"

namespace candela::test {

class FunctionTarget final : public mcmc::PrimaryTarget {
 public:
  // A value, and the place that it belongs to.
  using Function = std::function<std::pair<double, transport::FilmPosition>(mcmc::PrimaryState&)>;
  explicit FunctionTarget(Function function) : function_(std::move(function)) {}
  void evaluate(mcmc::PrimaryState& numbers, mcmc::SplatList& out) override {
    const auto [value, at] = function_(numbers);
    // White of luminance `value`, since luminances of one white sum to 1.
    out.add(at, Spectrum(static_cast<float>(value)));
  }

 private:
  Function function_;
};

inline float draw(mcmc::PrimaryState& numbers, std::uint32_t dimension) {
  return numbers.walk(mcmc::PrimaryState::eye).draw_1d(dimension, true);
}

// On [0, 1): a floor, a steep slope, a peak that small steps alone hardly leave, and a part that is zero.
inline double steep(double x) {
  if (x < 0.125) return 0;
  if (x < 0.5) return 0.05 + x * x;
  if (x < 0.53125) return 8;
  return 0.5 * (1 - x);
}
inline FunctionTarget one_dimension() {
  return FunctionTarget([](mcmc::PrimaryState& numbers) {
    const float x = draw(numbers, 0);
    return std::pair(steep(static_cast<double>(x)), transport::FilmPosition{x, 0});
  });
}

// On [0, 1)^2: a ridge along the diagonal, from one draw of two numbers.
inline double ridge(double x, double y) {
  return 0.02 + std::exp(-200 * (x - y) * (x - y)) * (0.2 + x);
}
inline FunctionTarget two_dimensions() {
  return FunctionTarget([](mcmc::PrimaryState& numbers) {
    const Vec2 p = numbers.walk(mcmc::PrimaryState::light).draw_2d(7, true);
    return std::pair(ridge(static_cast<double>(p.x), static_cast<double>(p.y)),
                     transport::FilmPosition{p.x, p.y});
  });
}

// The count of numbers asked for depends on their values: a path that grows and shrinks. Dimension 0 decides
// the length, 1 to 3 are read as far as it goes, and the value depends on all that were read, so that what is
// left behind is not uniform given the rest. The place is (first number, length / 4).
inline std::pair<double, transport::FilmPosition> growing_value(mcmc::PrimaryState& numbers) {
  const float x = draw(numbers, 0);
  const auto length = static_cast<std::uint32_t>(x * 4);
  double value = 0.2 + static_cast<double>(x);
  for (std::uint32_t i = 1; i <= length; ++i) {
    const auto u = static_cast<double>(draw(numbers, i));
    value *= 0.1 + 2.7 * u * u;  // of mean 1
  }
  return {value, {x, static_cast<float>(length) / 4}};
}
inline FunctionTarget growing() {
  return FunctionTarget(&growing_value);
}

}  // namespace candela::test
