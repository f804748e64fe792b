#include "common/job/effort.h"

#include <algorithm>
#include <limits>

namespace candela {
namespace {

constexpr double kSamplesPerSecond = 1 << 15;

constexpr std::uint64_t kMax = std::numeric_limits<std::uint64_t>::max();

std::uint64_t product(std::uint64_t a, std::uint64_t b) {
  return b != 0 && a > kMax / b ? kMax : a * b;
}

std::uint64_t rounded(double samples) {
  return samples < 0x1p63 ? static_cast<std::uint64_t>(samples) : kMax;
}

}  // namespace

Effort effort_of(std::uint64_t spp, const StopRule& stop, std::uint64_t pixels,
                 std::uint64_t samples_per_iteration) {
  std::uint64_t samples = kMax;
  if (spp > 0)
    samples = product(spp, pixels);
  else if (stop.iterations > 0)
    samples = product(product(stop.iterations, samples_per_iteration), pixels);
  if (stop.time_seconds > 0) samples = std::min(samples, rounded(stop.time_seconds * kSamplesPerSecond));
  if (stop.relmse > 0) samples = std::min(samples, rounded(static_cast<double>(pixels) / stop.relmse));
  return {pixels, spp, samples};
}

}  // namespace candela
