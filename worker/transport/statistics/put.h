// Writes statistics to an accumulator.
#pragma once

#include <cstdint>
#include <span>

#include "common/film/accumulator.h"

namespace candela::transport {

// Adds to the first channels of a pixel, without atomic operations if no other thread adds to it (`alone`):
// the sums are the same. False: a value is unusable, and none was added.
inline bool put_statistics(film::UnitAccumulator& sums, bool alone, std::uint32_t x, std::uint32_t y,
                           std::span<const double> values, std::uint64_t key) {
  film::SampleCounts ignored;
  return alone ? sums.add(x, y, 0, values, key, ignored) : sums.splat(x, y, 0, values, key, ignored);
}

}  // namespace candela::transport
