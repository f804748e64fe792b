// The path tracer's form with edits that select by more of the path than the vertex.
#include "worker/estimators/path_dispatch.h"
#include "worker/mcmc/primary_state.h"

namespace candela::estimators {

template <class SamplerT>
Spectrum path_radiance_with_edits(const scene::Scene& scene, const PathOptions& options,
                                  const Techniques& techniques, const Ray& ray, SamplerT& sampler,
                                  film::Tallies& tallies, const scene::LightGroups* /*groups*/,
                                  transport::EyeLetters* letters) {
  scene::EditedWalk walk(*scene.objects().path_edits);
  walk.begin_at_eye();
  constexpr transport::Between kBetween = transport::Between::media;
  if (letters != nullptr)
    return PathTracer<kBetween, scene::Scene, SamplerT, NoFirstVertex, true, false, true>(
               scene, options, techniques, sampler, tallies, nullptr, nullptr, letters, &walk)
        .radiance(ray);
  return PathTracer<kBetween, scene::Scene, SamplerT, NoFirstVertex, false, false, true>(
             scene, options, techniques, sampler, tallies, nullptr, nullptr, nullptr, &walk)
      .radiance(ray);
}
template Spectrum path_radiance_with_edits(const scene::Scene&, const PathOptions&, const Techniques&,
                                           const Ray&, samplers::Sampler&, film::Tallies&,
                                           const scene::LightGroups*, transport::EyeLetters*);
template Spectrum path_radiance_with_edits(const scene::Scene&, const PathOptions&, const Techniques&,
                                           const Ray&, mcmc::PrimarySampler&, film::Tallies&,
                                           const scene::LightGroups*, transport::EyeLetters*);

}  // namespace candela::estimators
