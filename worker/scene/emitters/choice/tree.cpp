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
  infinite_groups_ = std::min(infinite_.size(), kMaxInfiniteGroups);
  tree_.cut(kMaxGroups - infinite_groups_);
  groups_.assign(emitters.size(), 0);
  for (std::uint32_t i = 0; i < emitters.size(); ++i)
    if (!emitters.infinite(i)) groups_[i] = static_cast<std::uint8_t>(infinite_groups_ + tree_.group(i));
  for (std::size_t i = 0; i < infinite_.size(); ++i)
    groups_[infinite_[i]] = static_cast<std::uint8_t>(std::min(i, infinite_groups_ - 1));
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

// ---- the same with weights

double TreeChooser::weighted_tree(const Candidates& candidates, const ChoiceWeights& weights) const {
  if (tree_.empty()) return 0;
  return static_cast<double>(candidates.sum.share(candidates.tree, kEvenShare)) *
         static_cast<double>(weights.of_nodes[0]);
}
double TreeChooser::weighted_infinite(const Candidates& candidates, std::uint32_t emitter, Vec3 p, Vec3 front,
                                      const ChoiceWeights& weights) const {
  return static_cast<double>(
             candidates.sum.share(infinite(emitter, p, front, candidates.others), kEvenShare)) *
         weights.of_groups[groups_[emitter]];
}
double TreeChooser::weighted_sum(const Candidates& candidates, Vec3 p, Vec3 front,
                                 const ChoiceWeights& weights) const {
  double sum = weighted_tree(candidates, weights);
  for (const std::uint32_t i : infinite_) sum += weighted_infinite(candidates, i, p, front, weights);
  return sum;
}

bool TreeChooser::choose(Vec3 p, Vec3 front, double u, const ChoiceWeights& weights,
                         EmitterChoice& out) const {
  if (infinite_.empty()) return tree_.sample(p, front, u, weights.of_nodes, out.emitter, out.prob, out.rest);
  const Candidates candidates = find(p, front);
  const double sum = weighted_sum(candidates, p, front, weights);
  if (!(sum > 0)) return false;
  double left = u * sum;
  bool found = false;
  for (const std::uint32_t i : infinite_) {
    const double q = weighted_infinite(candidates, i, p, front, weights);
    if (!(q > 0)) continue;
    out = {i, static_cast<float>(q / sum), std::clamp(left / q, 0.0, 1.0 - 0x1p-53)};
    found = true;
    left -= q;
    if (left < 0) return true;
  }
  const double q = weighted_tree(candidates, weights);
  if (!(q > 0)) return found;  // rounding left a sliver beyond the last
  if (!tree_.sample(p, front, std::clamp(left / q, 0.0, 1.0 - 0x1p-53), weights.of_nodes, out.emitter,
                    out.prob, out.rest))
    return false;
  out.prob *= static_cast<float>(q / sum);
  return out.prob > 0;
}

float TreeChooser::prob(Vec3 p, Vec3 front, std::uint32_t emitter, const ChoiceWeights& weights) const {
  if (infinite_.empty()) return tree_.prob(p, front, emitter, weights.of_nodes);
  const Candidates candidates = find(p, front);
  const double sum = weighted_sum(candidates, p, front, weights);
  if (!(sum > 0)) return 0;
  if (emitters_->infinite(emitter))
    return static_cast<float>(weighted_infinite(candidates, emitter, p, front, weights) / sum);
  const double q = weighted_tree(candidates, weights);
  return q > 0 ? static_cast<float>(q / sum) * tree_.prob(p, front, emitter, weights.of_nodes) : 0.0f;
}

}  // namespace candela::scene
