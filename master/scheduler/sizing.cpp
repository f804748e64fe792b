#include "master/scheduler/sizing.h"

#include <algorithm>
#include <cmath>

namespace candela::master {

std::uint64_t unit_iterations(const SizingInput& in) {
  double seconds = std::clamp(in.overhead_seconds / 0.02, in.unit_seconds, 16 * in.unit_seconds);
  if (in.seconds_left > 0) seconds = std::min(seconds, in.seconds_left / 8);
  double n = 1;  // unknown cost: the smallest unit measures it
  if (in.seconds_per_iteration > 0) {
    n = std::floor(seconds / in.seconds_per_iteration);
    if (in.open_end) {
      const double workers = static_cast<double>(std::max<std::uint64_t>(in.active_workers, 1));
      const double grown = std::floor(static_cast<double>(in.cut_so_far) / (8 * workers));
      n = std::min(n, std::max(grown, std::floor(in.unit_seconds / 16 / in.seconds_per_iteration)));
    }
  }
  n = std::clamp(n, 1.0, static_cast<double>(kMaxUnitIterations));
  auto iterations = static_cast<std::uint64_t>(n);
  if (in.remaining > 0)
    iterations = std::min(iterations, in.remaining / (2 * std::max<std::uint64_t>(in.active_workers, 1)));
  return std::max<std::uint64_t>(iterations, 1);
}

}  // namespace candela::master
