// The path tracer as a function, by what may lie between two vertices.
#pragma once

#include "worker/estimators/path.h"
#include "worker/scene/objects.h"

namespace candela::estimators {

template <class SamplerT>
using RadianceFunction = Spectrum (*)(const scene::Scene&, const PathOptions&, const Techniques&, const Ray&,
                                      SamplerT&, film::SampleCounts&, const scene::LightGroups*,
                                      transport::EyeLetters*);

template <transport::EdgeContent kEdgeContent, class SamplerT, bool kLetters = false>
Spectrum path_radiance(const scene::Scene& scene, const PathOptions& options, const Techniques& techniques,
                       const Ray& ray, SamplerT& sampler, film::SampleCounts& sample_counts,
                       const scene::LightGroups* groups = nullptr, transport::EyeLetters* letters = nullptr) {
  return PathTracer<kEdgeContent, scene::Scene, SamplerT, NoFirstVertex, kLetters>(
             scene, options, techniques, sampler, sample_counts, nullptr, groups, letters)
      .radiance(ray);
}

template <class SamplerT, bool kLetters>
RadianceFunction<SamplerT> path_radiance_between(transport::EdgeContent between) {
  using transport::EdgeContent;
  switch (between) {
    case EdgeContent::nothing:
      return &path_radiance<EdgeContent::nothing, SamplerT, kLetters>;
    case EdgeContent::surfaces:
      return &path_radiance<EdgeContent::surfaces, SamplerT, kLetters>;
    case EdgeContent::media:
      break;
  }
  return &path_radiance<EdgeContent::media, SamplerT, kLetters>;
}

// Forms with letters, for layers by expressions. They have a file of their own: here they would change what
// the compiler inlines in the other forms.
template <class SamplerT>
RadianceFunction<SamplerT> path_radiance_with_letters(transport::EdgeContent between);

// A RadianceFunction with edits that select by more of the path than the vertex; it has no groups of lights
// and no letters. Precondition: the scene has such edits (SceneObjects::path_edits).
template <class SamplerT>
Spectrum path_radiance_with_edits(const scene::Scene& scene, const PathOptions& options,
                                  const Techniques& techniques, const Ray& ray, SamplerT& sampler,
                                  film::SampleCounts& sample_counts, const scene::LightGroups* groups,
                                  transport::EyeLetters* letters);

// letters: the function is called with letters; else without.
template <class SamplerT>
RadianceFunction<SamplerT> path_radiance_for(transport::EdgeContent between, bool letters) {
  return letters ? path_radiance_with_letters<SamplerT>(between)
                 : path_radiance_between<SamplerT, false>(between);
}

// The form that mollifies: next event estimation of delta lobes, as a cone each (transport/regularise.h). One
// form for all scenes, in a file of its own like those with letters. mollified: what that adds; may be null.
template <class SamplerT>
Spectrum mollified_path_radiance(const scene::Scene& scene, const PathOptions& options,
                                 const Techniques& techniques, const Ray& ray, SamplerT& sampler,
                                 film::SampleCounts& sample_counts, const scene::LightGroups* groups,
                                 const transport::Mollifier& mollifier, Spectrum* mollified = nullptr);
// The same, or that with edits if the scene has some that need it.
template <class SamplerT>
RadianceFunction<SamplerT> path_radiance_in(const scene::Scene& scene, transport::EdgeContent between,
                                            bool letters) {
  return scene.objects().path_edits != nullptr ? &path_radiance_with_edits<SamplerT>
                                               : path_radiance_for<SamplerT>(between, letters);
}

}  // namespace candela::estimators
