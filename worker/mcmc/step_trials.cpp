#include "worker/mcmc/step_trials.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/rng/stream.h"
#include "worker/mcmc/chain.h"

namespace candela::mcmc {
namespace {

constexpr std::array kImage{1.0, 0.25, 0.5, 2.0, 4.0};
// On one isotropic lobe 1.68 is the best [half-vector note, section 9].
constexpr std::array kRoughness{1.0, 0.25, 0.5, 1.7};

}  // namespace

std::vector<StepSize> sizes_of_trials(const MutatorEntry& entry) {
  std::vector<StepSize> out;
  for (const double image : kImage)
    for (const double roughness : kRoughness)
      if ((entry.has_image_step || image == 1) && (entry.has_roughness_step || roughness == 1))
        out.push_back({image, roughness});
  return out;
}

StepTrials::StepTrials(const MutatorContext& context, std::span<const MutatorShare> shares,
                       const ImageImportance* importance)
    : importance_(importance) {
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const std::vector<StepSize> sizes = sizes_of_trials(*shares[i].entry);
    if (sizes.size() < 2) continue;
    for (const StepSize& size : sizes) {
      const MutatorShare alone{shares[i].entry, 1, size};
      trials_.push_back({i, std::make_unique<PathSpace>(context, std::span(&alone, 1))});
    }
  }
}

void StepTrials::run(std::uint64_t start_key, std::uint64_t key, std::uint32_t proposals,
                     std::span<StepScore> scores) {
  SplatList present(importance_), proposal(importance_);
  film::SampleCounts unused;
  for (std::size_t i = 0; i < trials_.size(); ++i) {
    PathSpace& space = *trials_[i].space;
    space.start(start_key, present);
    const double scalar = usable_scalar(present, unused);
    if (!(scalar > 0) || !space.can_mutate()) continue;
    const std::uint64_t of_share = rng::combine(key, trials_[i].share);
    for (std::uint32_t j = 0; j < proposals; ++j) {
      const double ratio = space.propose({rng::combine(of_share, j), false}, proposal);
      const double proposed = usable_scalar(proposal, unused);
      if (proposed > 0 && ratio > 0)
        scores[i].moves += std::min(1.0, ratio * (proposed / scalar)) * space.squared_move();
      space.reject();
    }
    scores[i].rays += space.take_counts().front().rays;
  }
}

std::vector<StepSize> best_sizes(std::span<const MutatorShare> shares, std::span<const StepScore> scores) {
  std::vector<StepSize> out;
  std::size_t at = 0;
  for (const MutatorShare& share : shares) {
    const std::vector<StepSize> sizes = sizes_of_trials(*share.entry);
    StepSize best = sizes.front();
    if (sizes.size() > 1) {
      double largest = 0;
      for (const StepSize& size : sizes) {
        const StepScore& score = scores[at++];
        const double gain = score.moves / static_cast<double>(std::max<std::uint64_t>(score.rays, 1));
        if (!(gain > largest)) continue;
        largest = gain;
        best = size;
      }
    }
    out.push_back(best);
  }
  return out;
}

}  // namespace candela::mcmc
