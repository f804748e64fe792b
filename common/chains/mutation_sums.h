// Counts of mutations of jobs without long chains (erpt): no record of a chain carries them, so that they are
// sums beside the film, an accumulator for each mutation.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/chains/chains.h"
#include "common/film/accumulator.h"

namespace candela::chains {

inline constexpr std::string_view kMutationPrefix = "mutation.";
// Proposed, accepted, rays, failures by cause.
inline constexpr std::uint32_t kMutationChannels = 3 + kMutationFailures.size();

inline film::AccumulatorSpec mutation_spec(std::string_view mutation) {
  film::AccumulatorSpec spec;
  spec.name = std::string(kMutationPrefix) + std::string(mutation);
  spec.channels = kMutationChannels;
  spec.domain = film::AccumulatorSpec::Domain::table;
  spec.entries = 1;
  return spec;
}

// From any thread. Two calls must differ in key.
inline void add_counts(const MutationCounts& counts, std::uint64_t key, film::UnitAccumulator& to,
                       film::SampleCounts& sample_counts) {
  std::array<double, kMutationChannels> values{static_cast<double>(counts.proposed),
                                               static_cast<double>(counts.accepted),
                                               static_cast<double>(counts.rays)};
  for (std::size_t i = 0; i < counts.failed.size(); ++i)
    values[3 + i] = static_cast<double>(counts.failed[i]);
  to.splat(0, 0, 0, values, key, sample_counts);
}

// Returns nothing if the accumulator has no counts of mutations.
inline std::optional<MutationCounts> counts_of(const film::MergedAccumulator& sums) {
  const film::AccumulatorSpec& spec = sums.spec();
  if (!spec.name.starts_with(kMutationPrefix) ||
      spec != mutation_spec(spec.name.substr(kMutationPrefix.size())))
    return std::nullopt;
  const auto sum = [&](std::uint32_t channel) { return static_cast<std::uint64_t>(sums.sum(0, 0, channel)); };
  MutationCounts out{spec.name.substr(kMutationPrefix.size()), sum(0), sum(1), {}, sum(2)};
  for (std::uint32_t i = 0; i < out.failed.size(); ++i) out.failed[i] = sum(3 + i);
  return out;
}

}  // namespace candela::chains
