// Chooses the length of a path before anything of it is known. Light falls off geometrically with
// the number of scatterings, nearly without end where little is absorbed: lengths k = least + j are drawn
// with
//   p(j) = 3/4 q^j (1 - q) / (1 - q^n) + 1/4 (1 / ((j + 1) (j + 2))) / (1 - 1 / (n + 1)),   0 <= j < n
// of which the first part follows what light does (q = 0.6) and the second sees to it that no length, were it
// the thousandth, has a share much smaller than its number.
#pragma once

#include <cstdint>

namespace candela::mcmc {

class PathLengths {
 public:
  // Lengths from least to most edges, least <= most.
  PathLengths(std::uint32_t least, std::uint32_t most);

  struct Choice {
    std::uint32_t edges;
    double prob;
  };
  // u: uniform in [0, 1).
  Choice choose(double u) const;
  double prob(std::uint32_t edges) const;

 private:
  std::uint32_t least_, count_;
  double geometric_norm_, heavy_norm_;  // 1 - q^n, 1 - 1 / (n + 1)
};

}  // namespace candela::mcmc
