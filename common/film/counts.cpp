#include "common/film/counts.h"

#include "common/base/enum_names.h"

namespace candela::film {

std::string_view name(RejectCause cause) {
  return name_of_value<RejectCause::statistics>({"nan", "infinite", "negative", "saturated", "statistics"},
                                                cause, "unknown");
}

void SampleCounts::add(const SampleCounts& other) {
  eye_samples += other.eye_samples;
  light_paths += other.light_paths;
  rays += other.rays;
  for (std::size_t i = 0; i < rejected.size(); ++i) rejected[i] += other.rejected[i];
  sampled_merges += other.sampled_merges;
  repeated_merges += other.repeated_merges;
  bounded_walks += other.bounded_walks;
}

}  // namespace candela::film
