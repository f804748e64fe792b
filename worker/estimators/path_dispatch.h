// The path tracer as a function, by what may lie between two vertices.
#pragma once

#include "worker/estimators/path.h"

namespace candela::estimators {

template <class SamplerT>
using RadianceFunction = Spectrum (*)(const scene::Scene&, const PathOptions&, const Techniques&, const Ray&,
                                      SamplerT&, film::Tallies&, const scene::LightGroups*);

template <transport::Between kBetween, class SamplerT>
Spectrum path_radiance(const scene::Scene& scene, const PathOptions& options, const Techniques& techniques,
                       const Ray& ray, SamplerT& sampler, film::Tallies& tallies,
                       const scene::LightGroups* groups = nullptr) {
  return PathTracer<kBetween, scene::Scene, SamplerT>(scene, options, techniques, sampler, tallies, nullptr,
                                                      groups)
      .radiance(ray);
}

template <class SamplerT>
RadianceFunction<SamplerT> path_radiance_for(transport::Between between) {
  using transport::Between;
  switch (between) {
    case Between::nothing:
      return &path_radiance<Between::nothing, SamplerT>;
    case Between::surfaces:
      return &path_radiance<Between::surfaces, SamplerT>;
    case Between::media:
      break;
  }
  return &path_radiance<Between::media, SamplerT>;
}

}  // namespace candela::estimators
