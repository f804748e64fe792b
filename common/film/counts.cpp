#include "common/film/counts.h"

namespace candela::film {

std::string_view name(RejectCause cause) {
  switch (cause) {
    case RejectCause::not_a_number:
      return "nan";
    case RejectCause::infinite:
      return "infinite";
    case RejectCause::negative:
      return "negative";
    case RejectCause::saturated:
      return "saturated";
    case RejectCause::statistics:
      return "statistics";
  }
  return "unknown";
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
