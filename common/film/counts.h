// The counts that travel beside a film's sums.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace candela::film {

// Why a sample was kept out of the film; `statistics`: the sample is in the film, but an accumulator could
// not hold its statistics, so that none were added.
enum class RejectCause : std::uint8_t { not_a_number, infinite, negative, saturated, statistics };
inline constexpr int kRejectCauses = 5;
std::string_view name(RejectCause cause);  // "nan", "infinite", "negative", "saturated", "statistics"

// In reports of a job: SampleCounts::repeated_merges over sampled_merges.
inline constexpr std::string_view kRepeatedMerges = "share of repeated merges";

// Additive counts that travel with the sums.
struct SampleCounts {
  std::uint64_t eye_samples = 0;
  std::uint64_t light_paths = 0;
  std::uint64_t rays = 0;
  std::array<std::uint64_t, kRejectCauses> rejected{};
  // Photons within the radius of vertices of a sample of eye paths, whose merges decide radii; and those
  // photons that are not the first of their light path there.
  std::uint64_t sampled_merges = 0, repeated_merges = 0;
  // Paths and subpaths that hardly lost anything when they came to the number of edges from which Russian
  // roulette ends them all the same, so that the light of longer ones is missing, but for rare survivors.
  std::uint64_t bounded_walks = 0;
  void add(const SampleCounts& other);
  bool operator==(const SampleCounts&) const = default;
};

}  // namespace candela::film
