// The path tracer's form that mollifies.
#include "worker/estimators/path_dispatch.h"
#include "worker/mcmc/primary_state.h"

namespace candela::estimators {

template <class SamplerT>
Spectrum mollified_path_radiance(const scene::Scene& scene, const PathOptions& options,
                                 const Techniques& techniques, const Ray& ray, SamplerT& sampler,
                                 film::SampleCounts& sample_counts, const scene::LightGroups* groups,
                                 const transport::Mollifier& mollifier, Spectrum* mollified) {
  PathTracer<transport::EdgeContent::media, scene::Scene, SamplerT, NoFirstVertex, false, true> path(
      scene, options, techniques, sampler, sample_counts, nullptr, groups);
  path.mollify(mollifier);
  const Spectrum value = path.radiance(ray);
  if (mollified != nullptr) *mollified = path.mollified();
  return value;
}
template Spectrum mollified_path_radiance(const scene::Scene&, const PathOptions&, const Techniques&,
                                          const Ray&, samplers::Sampler&, film::SampleCounts&,
                                          const scene::LightGroups*, const transport::Mollifier&, Spectrum*);
template Spectrum mollified_path_radiance(const scene::Scene&, const PathOptions&, const Techniques&,
                                          const Ray&, mcmc::PrimarySampler&, film::SampleCounts&,
                                          const scene::LightGroups*, const transport::Mollifier&, Spectrum*);

}  // namespace candela::estimators
