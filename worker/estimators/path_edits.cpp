// The path tracer's form with edits that select by more of the path than the vertex.
#include "worker/estimators/path_dispatch.h"
#include "worker/mcmc/primary_state.h"

namespace candela::estimators {

template <class SamplerT>
Spectrum path_radiance_with_edits(const scene::Scene& scene, const PathOptions& options,
                                  const Techniques& techniques, const Ray& ray, SamplerT& sampler,
                                  film::SampleCounts& sample_counts, const scene::LightGroups* /*groups*/,
                                  transport::EyeLetters* letters) {
  scene::EditedWalk walk(*scene.objects().path_edits);
  walk.begin_at_eye();
  constexpr transport::EdgeContent kEdgeContent = transport::EdgeContent::media;
  if (letters != nullptr)
    return PathTracer<kEdgeContent, scene::Scene, SamplerT, NoFirstVertex, true, false, true>(
               scene, options, techniques, sampler, sample_counts, nullptr, nullptr, letters, &walk)
        .radiance(ray);
  return PathTracer<kEdgeContent, scene::Scene, SamplerT, NoFirstVertex, false, false, true>(
             scene, options, techniques, sampler, sample_counts, nullptr, nullptr, nullptr, &walk)
      .radiance(ray);
}
template Spectrum path_radiance_with_edits(const scene::Scene&, const PathOptions&, const Techniques&,
                                           const Ray&, samplers::Sampler&, film::SampleCounts&,
                                           const scene::LightGroups*, transport::EyeLetters*);
template Spectrum path_radiance_with_edits(const scene::Scene&, const PathOptions&, const Techniques&,
                                           const Ray&, mcmc::PrimarySampler&, film::SampleCounts&,
                                           const scene::LightGroups*, transport::EyeLetters*);

}  // namespace candela::estimators
