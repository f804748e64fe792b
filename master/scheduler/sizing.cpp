#include "master/scheduler/sizing.h"

#include <algorithm>
#include <cmath>

namespace candela::master {

namespace {
constexpr double kMergeShare = 0.4;  // of the time, at most
constexpr double kShortUnits = 4;    // at first, of each half
}  // namespace

std::uint64_t unit_iterations(const SizingInput& in) {
  const double workers = static_cast<double>(std::max<std::uint64_t>(in.active_workers, 1));
  const double round = in.merge_seconds * workers;  // of merging one delta of each worker
  double seconds = std::max(std::clamp(in.overhead_seconds / 0.02, in.unit_seconds, 16 * in.unit_seconds),
                            std::min(round / kMergeShare, 64 * in.unit_seconds));
  if (in.seconds_left > 0) seconds = std::min(seconds, in.seconds_left / 8);
  double n = 1;  // unknown cost: the smallest unit measures it
  if (in.seconds_per_iteration > 0) {
    n = std::floor(seconds / in.seconds_per_iteration);
    const auto cut = static_cast<double>(in.cut_so_far);
    const double early = std::max(1.0, std::floor(in.unit_seconds / 16 / in.seconds_per_iteration));
    const double first = std::max(early, std::floor(round / in.seconds_per_iteration));
    n = std::min(n, std::max(std::floor(cut / ((in.open_end ? 8 : 1) * workers)), first));
    if (cut < 2 * kShortUnits * early) n = std::min(n, early);
  }
  n = std::clamp(n, 1.0, static_cast<double>(kMaxUnitIterations));
  if (in.remaining > 0) {
    const double remaining = static_cast<double>(in.remaining);
    double guided = std::floor(remaining / (2 * workers));
    if (in.seconds_per_iteration > 0)
      guided = std::max(
          guided, std::min(std::floor(std::sqrt(in.merge_seconds * remaining / in.seconds_per_iteration)),
                           remaining));
    n = std::min(n, guided);
  }
  return static_cast<std::uint64_t>(std::max(n, 1.0));
}

}  // namespace candela::master
