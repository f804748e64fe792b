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

Candidate TreeChooser::infinite(std::uint32_t emitter, Vec3 p, Vec3 front, float others) const {
  const float importance = emitters_->importance(emitter, p, front);
  if (!emitters_->is_environment(emitter)) return candidate(importance);
  return environment_candidate(importance, emitters_->environment(emitter).variation(), others);
}

TreeChooser::Candidates TreeChooser::find(Vec3 p, Vec3 front) const {
  Candidates out;
  out.tree = candidate(tree_.importance(p, front));
  out.others = out.tree.importance;
  for (const std::uint32_t i : infinite_)
    if (!emitters_->is_environment(i)) out.others += emitters_->importance(i, p, front);
  out.sum.add(out.tree);
  for (const std::uint32_t i : infinite_) out.sum.add(infinite(i, p, front, out.others));
  return out;
}

bool TreeChooser::choose(Vec3 p, Vec3 front, double u, EmitterChoice& out) const {
  if (infinite_.empty()) return tree_.sample(p, front, u, out.emitter, out.prob, out.rest);
  const Candidates candidates = find(p, front);
  if (!(candidates.sum.importance > 0)) return false;
  double cumulative = 0;
  bool found = false;
  for (const std::uint32_t i : infinite_) {
    const float q = candidates.sum.share(infinite(i, p, front, candidates.others), kEvenShare);
    if (!(q > 0)) continue;
    out = {i, q, std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53)};
    found = true;
    cumulative += static_cast<double>(q);
    if (u < cumulative) return true;
  }
  const float q = candidates.sum.share(candidates.tree, kEvenShare);
  if (!(q > 0)) return found;  // rounding left a sliver beyond the last
  const double left = std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53);
  if (!tree_.sample(p, front, left, out.emitter, out.prob, out.rest)) return false;
  out.prob *= q;
  return out.prob > 0;
}

float TreeChooser::prob(Vec3 p, Vec3 front, std::uint32_t emitter) const {
  if (infinite_.empty()) return tree_.prob(p, front, emitter);
  const Candidates candidates = find(p, front);
  if (emitters_->infinite(emitter))
    return candidates.sum.share(infinite(emitter, p, front, candidates.others), kEvenShare);
  const float q = candidates.sum.share(candidates.tree, kEvenShare);
  return q > 0 ? q * tree_.prob(p, front, emitter) : 0.0f;
}

}  // namespace candela::scene
