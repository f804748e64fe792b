// The accumulators of optimal multiple importance sampling (common/mis/sums.h): names, channels and scales,
// and the sums of a pixel read from them. Each group of lights has a pair of accumulators.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/accumulator.h"
#include "common/job/job.h"
#include "common/mis/sums.h"

namespace candela::pixel_sums {

inline constexpr std::string_view kMatrix = "mis.matrix";  // S_A, packed
inline constexpr std::string_view kVector = "mis.vector";  // S_b, [color][technique]

// Bits below one of S_A's integers. Rounding changes an image by 1e-11 of itself.
inline constexpr int kMatrixScale = 32;
// S_b has as many bits more than the film: it is what slopes are from, not the image.
inline constexpr int kVectorBits = 4;

constexpr std::uint32_t matrix_channels(std::size_t techniques) {
  return static_cast<std::uint32_t>(mis::packed_size(techniques));
}
constexpr std::uint32_t vector_channels(std::size_t techniques) {
  return static_cast<std::uint32_t>(mis::kColors * techniques);
}

// Each group has two accumulators; those that are left belong to the job's AOVs.
inline constexpr std::size_t kMaxGroups = 8;
static_assert(2 * kMaxGroups <= film::kMaxAccumulators);

// Name of a group's accumulator: kMatrix, "mis.matrix.1", ...
std::string name_of(std::string_view accumulator, std::size_t group);

// Accumulators of the plan of work: for each group matrix and vector, in this order.
std::vector<film::AccumulatorSpec> specs(std::size_t techniques, int film_scale_log2, std::size_t groups = 1);
bool has_specs(const std::vector<film::AccumulatorSpec>& accumulators, std::size_t techniques,
               std::size_t groups);

// The numbers of samples as constants of a plan, and back. Precondition: counts are integers.
std::string counts_text(const mis::Allocation& allocation);
// Fails (input) unless there are 1 to kMaxTechniques whole numbers from 1 to 2^16. The error has no field.
Result<mis::Allocation> parse_counts(const SettingsMap& constants);

// The sums of a pixel. Null accumulators: zeros.
mis::Sums read(const film::MergedAccumulator* matrix, const film::MergedAccumulator* vector, std::uint32_t x,
               std::uint32_t y, std::size_t techniques);

}  // namespace candela::pixel_sums
