// Bidirectional path tracing as a function of random numbers: a path from the eye, through a place on the
// film that is a number too, and one from the light.
#pragma once

#include "worker/estimators/list_sink.h"
#include "worker/integrators/integrator.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators::chain_jobs {

// kMollifies: paths that no technique can sample are mollified, with this bandwidth. kEdits: as
// Bidirectional.
template <transport::EdgeContent kEdgeContent, bool kMollifies = false, bool kEdits = false>
class BdptTarget final : public mcmc::PrimaryTarget {
 public:
  BdptTarget(const UnitContext& context, const estimators::PathOptions& options,
             const estimators::Techniques& techniques, film::SampleCounts& sample_counts,
             [[maybe_unused]] double bandwidth = 0)
      : scene_(context.scene),
        film_(context.filter, context.width, context.height),
        sink_(film_),
        light_paths_(techniques.light_paths),
        estimator_(context.scene, options, techniques, one_of_each(film_), sink_, sample_counts,
                   context.letters),
        sample_counts_(sample_counts) {
    if constexpr (kMollifies) estimator_.set_bandwidth(bandwidth);
  }

  void evaluate(mcmc::PrimaryState& numbers, mcmc::SplatList& out) override {
    sink_.start(out);
    if (light_paths_) estimator_.trace_light(numbers.walk(mcmc::PrimaryState::light));
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    const estimators::FilmRay ray = film_ray(scene_, film_, eye);
    ++sample_counts_.eye_samples;
    estimator_.trace_eye(ray.ray, eye);
    sink_.finish_eye(ray.at, ray.weight, estimator_.layer_sums());
  }

 private:
  const scene::Scene& scene_;
  estimators::FilmDomain film_;
  using Config = estimators::ListConfig<kEdgeContent, estimators::EveryTechnique, kMollifies, kEdits>;
  typename Config::Sink sink_;
  bool light_paths_;
  estimators::Bidirectional<Config> estimator_;
  film::SampleCounts& sample_counts_;
};

}  // namespace candela::integrators::chain_jobs
