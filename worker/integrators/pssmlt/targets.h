// The estimators that pssmlt's chains follow, as functions of their random numbers: path tracing through a
// place on the film that is a number too, and bdpt (chains/bdpt_target.h).
#pragma once

#include <optional>

#include "worker/estimators/edited_subpaths.h"
#include "worker/estimators/list_sink.h"
#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/chains/bdpt_target.h"
#include "worker/integrators/integrator.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators::pssmlt {

using estimators::FilmRay;
using estimators::PathOptions;
using estimators::Techniques;

class PathTarget final : public mcmc::PrimaryTarget {
 public:
  PathTarget(const UnitContext& context, const PathOptions& options, const Techniques& techniques,
             estimators::RadianceFunction<mcmc::PrimarySampler> radiance, film::SampleCounts& sample_counts)
      : scene_(context.scene),
        options_(options),
        techniques_(techniques),
        radiance_(radiance),
        film_(context.filter, context.width, context.height),
        sample_counts_(sample_counts) {
    if (context.letters != nullptr) letters_.emplace(*context.letters);
  }

  void evaluate(mcmc::PrimaryState& numbers, mcmc::SplatList& out) override {
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    const FilmRay ray = film_ray(scene_, film_, eye);
    ++sample_counts_.eye_samples;
    if (letters_) letters_->begin(eye.sample_key(), ray.ray);
    const Spectrum value = radiance_(scene_, options_, techniques_, ray.ray, eye, sample_counts_, nullptr,
                                     letters_ ? &*letters_ : nullptr);
    const float scale = ray.weight * static_cast<float>(film_.area_over_film());
    if (out.add(ray.at, value * scale) && letters_) out.label(letters_->sums().sums(), Spectrum(scale));
  }

 private:
  const scene::Scene& scene_;
  const PathOptions& options_;
  const Techniques& techniques_;
  estimators::RadianceFunction<mcmc::PrimarySampler> radiance_;
  estimators::FilmDomain film_;
  film::SampleCounts& sample_counts_;
  std::optional<transport::EyeLetters> letters_;
};

using chain_jobs::BdptTarget;

}  // namespace candela::integrators::pssmlt
