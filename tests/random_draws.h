// Draws of named distributions for tests: the same for a key on every run of one machine.
#pragma once

#include <cmath>
#include <cstdint>

#include "common/rng/stream.h"

namespace candela::test {

class Draws {
 public:
  explicit Draws(std::uint64_t key) : stream_(key) {}
  double uniform() { return stream_.next_double(); }
  // Below n.
  std::uint64_t below(std::uint64_t n) {
    return static_cast<std::uint64_t>(uniform() * static_cast<double>(n));
  }
  double normal() {  // Box-Muller, one of two
    if (has_normal_) {
      has_normal_ = false;
      return normal_;
    }
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    const double angle = 6.283185307179586 * uniform();
    normal_ = radius * std::sin(angle);
    has_normal_ = true;
    return radius * std::cos(angle);
  }
  // Has mean 1; sigma 0 is the constant 1.
  double lognormal(double sigma) { return sigma > 0 ? std::exp(sigma * normal() - sigma * sigma / 2) : 1.0; }
  std::uint64_t poisson(double mean) {
    std::uint64_t count = 0;
    // In parts whose probability of no event does not underflow.
    for (; mean > 500; mean -= 500) count += part(500);
    return count + part(mean);
  }

 private:
  std::uint64_t part(double mean) {
    const double stop = std::exp(-mean);
    std::uint64_t count = 0;
    for (double product = uniform(); product > stop; product *= uniform()) ++count;
    return count;
  }
  rng::Stream stream_;
  double normal_ = 0;
  bool has_normal_ = false;
};

}  // namespace candela::test
