// Choice among any number of emitters: a light tree over those that have a place is one candidate beside
// those that are infinitely far away, chosen by importance. Half of that choice is even, since a tree's
// importance is a crude bound.
#pragma once

#include <cstdint>
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
  std::vector<std::uint32_t> infinite_;  // emitters that the tree does not hold
};

}  // namespace candela::scene
