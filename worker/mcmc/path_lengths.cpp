#include "worker/mcmc/path_lengths.h"

#include <algorithm>

#include "worker/core/math.h"

namespace candela::mcmc {
namespace {

constexpr double kGeometricShare = 0.75, kRatio = 0.6;

}  // namespace

PathLengths::PathLengths(std::uint32_t least, std::uint32_t most) : least_(least), count_(most - least + 1) {
  const auto n = static_cast<double>(count_);
  geometric_norm_ = 1 - math::pow(kRatio, n);
  heavy_norm_ = 1 - 1 / (n + 1);
}

PathLengths::Choice PathLengths::choose(double u) const {
  double j = 0;
  if (u < kGeometricShare) {
    const double share = u / kGeometricShare;
    j = math::log(1 - share * geometric_norm_) / math::log(kRatio);
  } else {
    const double share = (u - kGeometricShare) / (1 - kGeometricShare);
    j = 1 / (1 - share * heavy_norm_) - 1;  // P(J >= j) = 1 / (j + 1), cut off behind n
  }
  const auto step = static_cast<std::uint32_t>(std::clamp(j, 0.0, static_cast<double>(count_ - 1)));
  return {least_ + step, prob(least_ + step)};
}

double PathLengths::prob(std::uint32_t edges) const {
  const auto j = static_cast<double>(edges - least_);
  return kGeometricShare * math::pow(kRatio, j) * (1 - kRatio) / geometric_norm_ +
         (1 - kGeometricShare) / ((j + 1) * (j + 2)) / heavy_norm_;
}

}  // namespace candela::mcmc
