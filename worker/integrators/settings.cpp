#include "worker/integrators/settings.h"

#include <algorithm>

#include "common/description/vocabulary.h"

namespace candela::integrators {

Result<void> SettingsReader::finish() const {
  if (!ok_) return Error(error_);
  for (const auto& [key, value] : map_) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    const std::vector<std::string_view> known(known_.begin(), known_.end());
    const std::string_view near = description::nearest_name(key, known);
    return usage_error("unknown integrator setting")
        .with_field(key)
        .with_mend(near.empty() ? fmt::format("there are {}", fmt::join(known_, ", "))
                                : fmt::format("did you mean '{}'?", near));
  }
  return {};
}

}  // namespace candela::integrators
