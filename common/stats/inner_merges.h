// The bias of photons, measured in each iteration: the image less the one that the photons within half of the
// radius make. The second has half of a bias that goes as the radius, so that their difference is the other
// half. It is a mean over all iterations, while what the movement of the image tells (movement.h) is a slope
// over radii that hardly differ.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "common/film/accumulator.h"
#include "common/stats/movement.h"

namespace candela::stats {

inline constexpr const char* kInnerMerges = "merging.inner";

// The job's accumulator: a sum for each block of pixels (block_side()).
film::AccumulatorSpec inner_merges_spec(std::uint32_t width, std::uint32_t height, int film_scale_log2);
// Finds the accumulator among those of a unit. Returns null if the unit has none.
film::UnitAccumulator* find_inner_merges(std::span<const std::unique_ptr<film::UnitAccumulator>> of_unit);
// Adds a sample of a pixel that only the calling thread adds to. A value that is unusable is left out.
void add_inner_merges(film::UnitAccumulator& to, std::uint32_t width, std::uint32_t height, std::uint32_t x,
                      std::uint32_t y, const std::array<double, film::kChannels>& difference,
                      std::uint64_t key);

// The bias of the means of both halves, of n0 and n1 iterations. Empty unless both have some, and sums.
Movement::Bias measured_bias(const std::array<const film::MergedAccumulator*, 2>& halves, std::uint32_t width,
                             std::uint32_t height, double n0, double n1);

}  // namespace candela::stats
