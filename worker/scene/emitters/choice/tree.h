// Choice among any number of emitters: a light tree over those that have a place is one candidate beside
// those that are infinitely far away, chosen by importance. Half of that choice is even, since a tree's
// importance is a crude bound.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "worker/scene/emitters/choice/choice.h"
#include "worker/scene/emitters/choice/light_tree.h"
#include "worker/scene/emitters/emitter_set.h"

namespace candela::scene {

class TreeChooser {
 public:
  // Over none.
  TreeChooser() = default;
  // The emitters must outlive this. powers: by emitter.
  TreeChooser(const EmitterSet& emitters, const Geometry& geometry, const std::vector<double>& powers);

  bool choose(Vec3 p, Vec3 front, double u, EmitterChoice& out) const;
  float prob(Vec3 p, Vec3 front, std::uint32_t emitter) const;

  // Groups of emitters that share a weight: one for each emitter that is infinitely far away, all beyond
  // the first kMaxInfiniteGroups in one, then nodes of the tree.
  static constexpr std::size_t kMaxGroups = 64, kMaxInfiniteGroups = 32, kMaxNodes = 2 * kMaxGroups;
  std::uint32_t group(std::uint32_t emitter) const { return groups_[emitter]; }
  std::span<const float> node_weights(std::span<const std::uint8_t> of_groups, std::span<float> out) const {
    return tree_.node_weights(of_groups.subspan(infinite_groups_), out);
  }
  // The same choice, each importance and share times its weight.
  bool choose(Vec3 p, Vec3 front, double u, const ChoiceWeights& weights, EmitterChoice& out) const;
  float prob(Vec3 p, Vec3 front, std::uint32_t emitter, const ChoiceWeights& weights) const;

 private:
  static constexpr float kEvenShare = 0.5f;

  // All candidates: the tree, and what is infinitely far away.
  struct Candidates {
    Candidate tree{0, 0};
    float others = 0;  // importance of all but environments
    CandidateSum sum;
  };
  Candidates find(Vec3 p, Vec3 front) const;
  Candidate infinite(std::uint32_t emitter, Vec3 p, Vec3 front, float others) const;

  const EmitterSet* emitters_ = nullptr;
  LightTree tree_;
  // With weights: the share of a candidate, and the sum of all.
  double weighted_tree(const Candidates& candidates, const ChoiceWeights& weights) const;
  double weighted_infinite(const Candidates& candidates, std::uint32_t emitter, Vec3 p, Vec3 front,
                           const ChoiceWeights& weights) const;
  double weighted_sum(const Candidates& candidates, Vec3 p, Vec3 front, const ChoiceWeights& weights) const;

  std::vector<std::uint32_t> infinite_;  // emitters that the tree does not hold
  std::size_t infinite_groups_ = 0;
  std::vector<std::uint8_t> groups_;  // by emitter
};

}  // namespace candela::scene
