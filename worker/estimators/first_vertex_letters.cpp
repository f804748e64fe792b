#include "worker/estimators/first_vertex_letters.h"

namespace candela::estimators {
namespace {

template <transport::EdgeContent kEdgeContent>
Spectrum radiance(const scene::Scene& scene, const Techniques& techniques, const Ray& ray,
                  samplers::Sampler& sampler, film::SampleCounts& sample_counts, FirstVertex& first,
                  transport::EyeLetters& letters) {
  return PathTracer<kEdgeContent, scene::Scene, samplers::Sampler, FirstVertex, true>(
             scene, first.options(), techniques, sampler, sample_counts, &first, nullptr, &letters)
      .radiance(ray);
}

}  // namespace

LetteredFirstVertex first_vertex_with_letters(transport::EdgeContent between) {
  using transport::EdgeContent;
  switch (between) {
    case EdgeContent::nothing:
      return &radiance<EdgeContent::nothing>;
    case EdgeContent::surfaces:
      return &radiance<EdgeContent::surfaces>;
    case EdgeContent::media:
      break;
  }
  return &radiance<EdgeContent::media>;
}

}  // namespace candela::estimators
