// JSON for scripts of what is no message of the farm. The messages are in common/wire/json.h; its rules hold
// here, too.
#pragma once

#include <string>

#include "common/description/object_list.h"
#include "common/stats/image_difference.h"

namespace candela::client {

std::string submitted_group_json(const std::string& id, std::size_t frames, std::size_t existed,
                                 std::uint64_t uploaded_bytes);
std::string submitted_json(const std::string& id, bool existed, std::uint64_t uploaded_bytes);
// The layer of variance of a file: whether it has one, and how many of its values are no variance.
struct KnownVariance {
  bool known = false;
  std::ptrdiff_t invalid = 0;
};
// `difference`: null if neither file has variances.
std::string comparison_json(const stats::ImageComparison& comparison,
                            const stats::ImageDifference* difference, KnownVariance variance,
                            KnownVariance reference);
std::string version_json();
std::string plan_json(const std::string& integrator, const std::map<std::string, std::string>& settings,
                      const std::string& plan);

// Writes `candela objects` as JSON: "surfaces", "lamps", "media", lists of {name, count, kinds, bounds}.
std::string objects_json(const description::ObjectList& objects);

}  // namespace candela::client
