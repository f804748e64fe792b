#include "worker/scene/emitters/choice/importance.h"

namespace candela::scene {

void ImportanceChooser::finish() {
  surfaces_ = {};
  others_.clear();
  const auto count = static_cast<std::uint32_t>(emitters_->size());
  std::size_t surfaces = 0;
  for (std::uint32_t i = 0; i < count; ++i) surfaces += emitters_->lane(i).has_value() ? 1 : 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::optional<SurfaceLane> lane = emitters_->lane(i);
    if (surfaces > kFewSurfaces && lane)
      surfaces_.add(i, *lane);
    else
      others_.push_back(i);
  }
}

// Flat: a call of each emitter takes a seventh more instructions.
[[gnu::flatten]] CandidateSum ImportanceChooser::find(Vec3 p, Vec3 front, Candidates& out) const {
  std::array<float, kMaxEmitters> importance;
  for (const std::uint32_t i : others_) importance[i] = emitters_->importance(i, p, front);
  if (!surfaces_.empty()) {
    surfaces_.importances(p, front, importance.data());
    for (const std::uint32_t i : surfaces_.to_ask())
      if (importance[i] > 0 && !emitters_->reaches(i, p)) importance[i] = 0;
  }
  CandidateSum sum;
  for (std::size_t i = 0; i < emitters_->size(); ++i) {
    out[i] = candidate(importance[i]);
    if (!emitters_->is_environment(static_cast<std::uint32_t>(i))) sum.add(out[i]);
  }
  const float others = sum.importance;
  for (const std::uint32_t i : emitters_->environments()) {
    out[i] = environment_candidate(out[i].importance, emitters_->environment(i).variation(), others);
    sum.add(out[i]);
  }
  return sum;
}

}  // namespace candela::scene
