// The estimators that pssmlt's chains follow, as functions of their random numbers: one path from the eye
// through a place on the film that is a number too, and for bdpt one from the light.
#pragma once

#include "worker/integrators/bdpt/kernel.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/markov/list_sink.h"
#include "worker/integrators/path/kernels.h"
#include "worker/mcmc/primary_space.h"

namespace candela::integrators::pssmlt {

// The ray of the eye's numbers, dimensions 0 and, where the lens is finite, 1.
struct FilmRay {
  transport::FilmPosition at;
  Ray ray;
  float weight = 1;
};
inline FilmRay film_ray(const scene::Scene& scene, const markov::FilmDomain& film,
                        mcmc::PrimarySampler& numbers) {
  FilmRay result;
  result.at = film.at(numbers.draw_2d(0, true));
  result.ray =
      scene.camera_ray(result.at.x, result.at.y,
                       scene.reads_lens() ? numbers.draw_2d(1, true) : Vec2{0.5f, 0.5f}, result.weight);
  return result;
}

class PathTarget final : public mcmc::PrimaryTarget {
 public:
  PathTarget(const UnitContext& context, const path::Limits& limits,
             path::RadianceFunction<mcmc::PrimarySampler> kernel, film::Tallies& tallies)
      : scene_(context.scene),
        limits_(limits),
        kernel_(kernel),
        film_(context.filter, context.width, context.height),
        tallies_(tallies) {}

  void evaluate(mcmc::PrimaryState& numbers, mcmc::SplatList& out) override {
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    const FilmRay ray = film_ray(scene_, film_, eye);
    ++tallies_.eye_samples;
    const Spectrum value = kernel_(scene_, limits_, ray.ray, eye, tallies_);
    out.add(ray.at, value * (ray.weight * static_cast<float>(film_.area_over_film())));
  }

 private:
  const scene::Scene& scene_;
  const path::Limits& limits_;
  path::RadianceFunction<mcmc::PrimarySampler> kernel_;
  markov::FilmDomain film_;
  film::Tallies& tallies_;
};

// Of bdpt's kernel. ChoiceT: see there.
template <transport::Between kB, class ChoiceT>
struct ListConfig {
  static constexpr transport::Between kBetween = kB;
  static constexpr bool kLists = false;
  using Heuristic = transport::Balance;
  using Sampler = mcmc::PrimarySampler;
  using Sink = markov::ListSink;
  using Choice = ChoiceT;
};

// A path from the eye, uniform over the domain, and one from the light.
inline bdpt::PathCounts one_of_each(const markov::FilmDomain& film) {
  return {1 / film.area_over_film(), 1, film.border()};
}

template <transport::Between kBetween>
class BdptTarget final : public mcmc::PrimaryTarget {
 public:
  BdptTarget(const UnitContext& context, const bdpt::Limits& limits, const bdpt::Techniques& techniques,
             film::Tallies& tallies)
      : scene_(context.scene),
        film_(context.filter, context.width, context.height),
        sink_(film_),
        light_paths_(techniques.light_paths),
        kernel_(context.scene, limits, techniques, one_of_each(film_), sink_, tallies),
        tallies_(tallies) {}

  void evaluate(mcmc::PrimaryState& numbers, mcmc::SplatList& out) override {
    sink_.start(out);
    if (light_paths_) kernel_.trace_light(numbers.walk(mcmc::PrimaryState::light));
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    const FilmRay ray = film_ray(scene_, film_, eye);
    ++tallies_.eye_samples;
    kernel_.trace_eye(ray.ray, eye);
    sink_.finish_eye(ray.at, ray.weight);
  }

 private:
  const scene::Scene& scene_;
  markov::FilmDomain film_;
  markov::ListSink sink_;
  bool light_paths_;
  bdpt::Kernel<ListConfig<kBetween, bdpt::EveryTechnique>> kernel_;
  film::Tallies& tallies_;
};

}  // namespace candela::integrators::pssmlt
