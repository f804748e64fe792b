// Verdict on a delta.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace candela::master {

enum class DeltaVerdict : std::uint8_t {
  merged,
  duplicate,    // the unit is merged already, by this or another worker; dropped
  stale,        // the lease is not the sender's any more; dropped
  corrupt,      // hash, length or content do not hold; dropped, counted as a failure of the unit
  wrong_build,  // made by another build; dropped
  job_ended,    // cancelled or done meanwhile; dropped
};
inline constexpr std::size_t kDeltaVerdicts = 6;

constexpr std::size_t index_of(DeltaVerdict verdict) {
  return static_cast<std::size_t>(verdict);
}

// As the metrics have it: "MERGED", "DUPLICATE", ...
constexpr std::string_view name(DeltaVerdict verdict) {
  constexpr std::array<std::string_view, kDeltaVerdicts> kNames = {"MERGED",  "DUPLICATE",   "STALE",
                                                                   "CORRUPT", "WRONG_BUILD", "JOB_ENDED"};
  return kNames[index_of(verdict)];
}

}  // namespace candela::master
