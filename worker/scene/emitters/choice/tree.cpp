#include "worker/scene/emitters/choice/tree.h"

#include <algorithm>
#include <utility>

namespace candela::scene {

TreeChooser::TreeChooser(const EmitterSet& emitters, const Geometry& geometry,
                         const std::vector<double>& powers)
    : emitters_(&emitters) {
  std::vector<LightBounds> placed;
  for (std::uint32_t i = 0; i < emitters.size(); ++i) {
    if (const auto bounds = emitters.bounds(i, geometry)) {
      placed.push_back(*bounds);
      placed.back().power = powers[i];
    } else {
      infinite_.push_back(i);
    }
  }
  tree_ = LightTree(std::move(placed), emitters.size());
}

float TreeChooser::importances(Vec3 p, Vec3 front, float& tree, std::uint32_t& positive_count) const {
  tree = tree_.importance(p, front);
  float sum = tree;
  positive_count = tree > 0 ? 1 : 0;
  for (const std::uint32_t i : infinite_) {
    const float value = emitters_->importance(i, p, front);
    sum += value;
    positive_count += value > 0 ? 1u : 0u;
  }
  return sum;
}

bool TreeChooser::choose(Vec3 p, Vec3 front, double u, EmitterChoice& out) const {
  if (infinite_.empty()) return tree_.sample(p, front, u, out.emitter, out.prob, out.rest);
  float tree = 0;
  std::uint32_t positive_count = 0;
  const float sum = importances(p, front, tree, positive_count);
  if (positive_count == 0) return false;
  double cumulative = 0;
  bool found = false;
  for (const std::uint32_t i : infinite_) {
    const float q = mixed_share(kEvenShare, emitters_->importance(i, p, front), sum, positive_count);
    if (!(q > 0)) continue;
    out = {i, q, std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53)};
    found = true;
    cumulative += static_cast<double>(q);
    if (u < cumulative) return true;
  }
  const float q = mixed_share(kEvenShare, tree, sum, positive_count);
  if (!(q > 0)) return found;  // rounding left a sliver beyond the last
  const double left = std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53);
  if (!tree_.sample(p, front, left, out.emitter, out.prob, out.rest)) return false;
  out.prob *= q;
  return out.prob > 0;
}

float TreeChooser::prob(Vec3 p, Vec3 front, std::uint32_t emitter) const {
  if (infinite_.empty()) return tree_.prob(p, front, emitter);
  float tree = 0;
  std::uint32_t positive_count = 0;
  const float sum = importances(p, front, tree, positive_count);
  if (emitters_->infinite(emitter))
    return mixed_share(kEvenShare, emitters_->importance(emitter, p, front), sum, positive_count);
  const float q = mixed_share(kEvenShare, tree, sum, positive_count);
  return q > 0 ? q * tree_.prob(p, front, emitter) : 0.0f;
}

}  // namespace candela::scene
