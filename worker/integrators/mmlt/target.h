// One technique for one path length, chosen by numbers of their own: the estimator that mmlt's chains follow.
// Its value is that of the technique with its weight [Hachisuka 2014, Eq. 11], over the probability of having
// chosen length and technique. The length changes in large steps alone: small ones would change what the
// dimensions of all other numbers mean.
#pragma once

#include "worker/estimators/edited_subpaths.h"
#include "worker/estimators/list_sink.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/mmlt/lengths.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators::mmlt {

// The techniques that can make paths of one length, by number: s = 0, 1, those that connect vertices, s = k
// (to the lens), s = k + 1 (meets the lens), as far as they run.
struct TechniqueCount {
  std::uint32_t hit_light, next_event, connect, light_image, hit_lens;
  std::uint32_t all() const { return hit_light + next_event + connect + light_image + hit_lens; }
};
inline TechniqueCount techniques_of(std::uint32_t edges, const estimators::Techniques& t) {
  const auto one = [](bool runs) { return runs ? 1u : 0u; };
  return {one(t.hit_light && edges >= 1), one(t.next_event && edges >= 2),
          t.connect && edges >= 3 ? edges - 2 : 0, one(t.light_image && edges >= 2),
          one(t.hit_lens && edges >= 2)};
}
// Number `choice` of them, in the order above.
inline estimators::OneTechnique technique(std::uint32_t edges, const TechniqueCount& count,
                                          std::uint32_t choice) {
  const auto made_with = [&](std::uint32_t s) { return estimators::OneTechnique{s, edges + 1 - s}; };
  if (choice < count.hit_light) return made_with(0);
  choice -= count.hit_light;
  if (choice < count.next_event) return made_with(1);
  choice -= count.next_event;
  if (choice < count.connect) return made_with(2 + choice);
  choice -= count.connect;
  return made_with(choice < count.light_image ? edges : edges + 1);
}

// kMollifies: paths that no technique can sample are mollified, with this bandwidth. kEdits: as
// Bidirectional.
template <transport::EdgeContent kEdgeContent, bool kMollifies = false, bool kEdits = false>
class Target final : public mcmc::PrimaryTarget {
 public:
  Target(const UnitContext& context, const estimators::PathOptions& options,
         const estimators::Techniques& techniques, const Lengths& lengths, film::SampleCounts& sample_counts,
         [[maybe_unused]] double bandwidth = 0)
      : scene_(context.scene),
        film_(context.filter, context.width, context.height),
        sink_(film_),
        techniques_(techniques),
        lengths_(lengths),
        estimator_(context.scene, options, techniques, estimators::one_of_each(film_), sink_, sample_counts,
                   context.letters),
        sample_counts_(sample_counts) {
    if constexpr (kMollifies) estimator_.set_bandwidth(bandwidth);
  }

  void evaluate(mcmc::PrimaryState& numbers, mcmc::SplatList& out) override {
    mcmc::PrimarySampler& choice = numbers.walk(mcmc::PrimaryState::choice);
    const Lengths::Choice length = lengths_.choose(choice.draw_fixed(kLength));
    const TechniqueCount count = techniques_of(length.edges, techniques_);
    const std::uint32_t all = count.all();
    if (all == 0) return;
    const float u = choice.draw_1d(kTechnique, true);
    const estimators::OneTechnique chosen = technique(
        length.edges, count, std::min(static_cast<std::uint32_t>(u * static_cast<float>(all)), all - 1));
    estimator_.choose(chosen);
    sink_.start(out, static_cast<float>(static_cast<double>(all) / length.prob));
    if (chosen.s > 1)
      estimator_.trace_light(numbers.walk(mcmc::PrimaryState::light));
    else
      estimator_.no_light();
    if (chosen.t < 2) return;
    if (chosen.s > 1 && estimator_.no_light_vertices()) return;  // nothing to connect to
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    const estimators::FilmRay ray = estimators::film_ray(scene_, film_, eye);
    ++sample_counts_.eye_samples;
    estimator_.trace_eye(ray.ray, eye);
    sink_.finish_eye(ray.at, ray.weight, estimator_.layer_sums());
  }

 private:
  static constexpr std::uint32_t kLength = 0, kTechnique = 1;  // dimensions

  const scene::Scene& scene_;
  estimators::FilmDomain film_;
  using Config = estimators::ListConfig<kEdgeContent, estimators::OneTechnique, kMollifies, kEdits>;
  typename Config::Sink sink_;
  const estimators::Techniques& techniques_;
  const Lengths& lengths_;
  estimators::Bidirectional<Config> estimator_;
  film::SampleCounts& sample_counts_;
};

}  // namespace candela::integrators::mmlt
