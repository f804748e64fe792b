// Choice by an importance of each emitter at the reference: an estimate of the irradiance it would give
// unoccluded, from its power, distance and the cosines at both ends bounded over its extent (in the manner of
// Conty Estevez and Kulla 2018, and pbrt-v4's light bounds). It is zero only where the emitter cannot light
// the point at all. A tenth of the choice goes evenly to all that are not zero, since an irradiance says
// little about a glossy lobe. Linear in the number of emitters.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "worker/scene/emitters/choice/choice.h"
#include "worker/scene/emitters/choice/surface_lanes.h"
#include "worker/scene/emitters/emitter_set.h"

namespace candela::scene {

class ImportanceChooser {
 public:
  static constexpr std::size_t kMaxEmitters = 64;

  // The emitters must outlive this; when it is asked there are at most kMaxEmitters.
  explicit ImportanceChooser(const EmitterSet& emitters) : emitters_(&emitters) {}
  // After the last emitter.
  void finish();

  bool choose(Vec3 p, Vec3 front, double u, EmitterChoice& out) const {
    Candidates candidates;
    const CandidateSum sum = find(p, front, candidates);
    if (!(sum.importance > 0)) return false;
    double cumulative = 0;
    bool found = false;
    for (std::size_t i = 0; i < emitters_->size(); ++i) {
      const float q = sum.share(candidates[i], kEvenShare);
      if (!(q > 0)) continue;
      out.emitter = static_cast<std::uint32_t>(i);
      out.prob = q;
      found = true;
      out.rest = std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53);
      cumulative += static_cast<double>(q);
      if (u < cumulative) break;
    }
    return found;
  }

  float prob(Vec3 p, Vec3 front, std::uint32_t emitter) const {
    Candidates candidates;
    const CandidateSum sum = find(p, front, candidates);
    return sum.share(candidates[emitter], kEvenShare);
  }

  // The same, the probability of each emitter times its weight, over the sum of these. Each is a group.
  using Weights = const ChoiceWeights&;
  bool choose(Vec3 p, Vec3 front, double u, Weights weights, EmitterChoice& out) const {
    Products products;
    const double sum = find(p, front, weights, products);
    if (!(sum > 0)) return false;
    double left = u * sum;
    bool found = false;
    for (std::size_t i = 0; i < emitters_->size(); ++i) {
      const double q = products[i];
      if (!(q > 0)) continue;
      out.emitter = static_cast<std::uint32_t>(i);
      out.prob = static_cast<float>(q / sum);
      found = true;
      out.rest = std::clamp(left / q, 0.0, 1.0 - 0x1p-53);
      left -= q;
      if (left < 0) break;
    }
    return found;
  }
  float prob(Vec3 p, Vec3 front, std::uint32_t emitter, Weights weights) const {
    Products products;
    const double sum = find(p, front, weights, products);
    return sum > 0 ? static_cast<float>(products[emitter] / sum) : 0.0f;
  }

 private:
  static constexpr float kEvenShare = 0.1f;
  using Candidates = std::array<Candidate, kMaxEmitters>;

  CandidateSum find(Vec3 p, Vec3 front, Candidates& out) const;

  using Products = std::array<double, kMaxEmitters>;
  // Returns the sum of the products.
  double find(Vec3 p, Vec3 front, Weights weights, Products& out) const {
    Candidates candidates;
    const CandidateSum all = find(p, front, candidates);
    double sum = 0;
    for (std::size_t i = 0; i < emitters_->size(); ++i) {
      out[i] = static_cast<double>(all.share(candidates[i], kEvenShare)) * weights.of_groups[i];
      sum += out[i];
    }
    return sum;
  }

  // Fewer surfaces are asked one by one: a block of lanes costs as much as three of them.
  static constexpr std::size_t kFewSurfaces = 3;

  const EmitterSet* emitters_;
  // If there are more surfaces: these, and all other emitters.
  SurfaceLanes surfaces_;
  std::vector<std::uint32_t> others_;
};

}  // namespace candela::scene
