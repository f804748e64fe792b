// The result of a technique, and the input that all of them need. The techniques are those of
// mis/balance_power.h, a file each; each gives the value of its estimator without the weight, and the weight.
#pragma once

#include <bit>
#include <cstdint>

#include "common/film/counts.h"
#include "worker/transport/between.h"
#include "worker/transport/draws.h"
#include "worker/transport/mis/factors.h"
#include "worker/transport/vertex.h"
#include "worker/transport/walk.h"

namespace candela::transport {

struct Contribution {
  Spectrum value;  // unweighted: value * weight is what goes to the film
  double weight = 0;
  bool is_black() const { return value.is_black(); }
  Spectrum weighted() const { return value * static_cast<float>(weight); }
};

// The sampled end of a path, for letters: the direction from the vertex, and
// for next event estimation the light.
struct Towards {
  Vec3 wi;
  std::uint32_t emitter = scene::kNone;
};

// The terms of a weight, for heuristics that look at each technique (technique_list.h). Densities relative to
// that of the technique at hand. next: the neighboring technique that is no connection of vertices.
// light_step and light_reverse: the last light vertex as the eye's walk samples it, and that vertex's
// pdf_reverse; eye_step and eye_reverse likewise.
struct WeightTerms {
  double next = 0;
  double light_step = 0, light_reverse = 0;
  double eye_step = 0, eye_reverse = 0;
};

// True if Scene::sample_direct reads its u_select: a fact of the scene.
template <class SceneT>
bool reads_emitter_choice(const SceneT& scene) {
  const scene::SceneFeatures& features = scene.features();
  return features.emitters > 1 || features.any_mesh_emitter;
}

// Common to the techniques of an estimator.
struct ConnectContext {
  const scene::Scene& scene;
  const MisFactors& factors;
  const WalkRules& rules;
  film::SampleCounts& sample_counts;
  const bool chooses_emitter = reads_emitter_choice(scene);
  const bool passes_through = scene.features().any_passthrough;
  const bool has_media = scene.features().media > 0;
};

enum class SubpathOf : std::uint8_t { light, eye };

// The sum of the eta of merges at the vertex v of a subpath, if the path turns between v.wo and wi: in the
// unit of Mis::sum. survival: of the edge along wi.
template <class Mis>
double merges_at(const ConnectContext& c, [[maybe_unused]] SubpathOf side, const ScatterPoint& v,
                 [[maybe_unused]] Vec3 wi, [[maybe_unused]] double survival, const MergeFactors& eta) {
  if (v.on_surface()) return eta.surface;
  if constexpr (Mis::kMergesBeams) {
    const auto own = static_cast<double>(v.survival);
    const bool light = side == SubpathOf::light;
    return Mis::merges(c.factors.medium[v.medium], v.arrival, v.wo, wi, light ? own : survival,
                       light ? survival : own);
  } else {
    return eta.medium;
  }
}

// The medium that an edge begins in which leaves v in direction w.
inline std::uint32_t medium_towards(const ConnectContext& c, const ScatterPoint& v, Vec3 w) {
  return v.on_surface() ? c.scene.medium_beyond(v.hit, w, v.medium) : v.medium;
}

// False if the media at the ends of an edge say that a surface blocks it: where no surface lets light pass
// straight on, an edge that nothing blocks lies in one medium. w: from y to z.
template <EdgeContent kEdgeContent>
bool may_meet(const ConnectContext& c, const ScatterPoint& y, const ScatterPoint& z, Vec3 w) {
  if constexpr (kEdgeContent != EdgeContent::media) return true;
  return c.passes_through || !c.has_media || medium_towards(c, y, w) == medium_towards(c, z, -w);
}

// As passing(), in a scene where no surface lets light pass straight on: all of an edge that nothing blocks
// lies in one medium, and what blocks it need not be known.
inline Spectrum through_one_medium(const ConnectContext& c, const Ray& shadow_ray, std::uint32_t medium,
                                   std::uint64_t stream_key, double& survival) {
  ++c.sample_counts.rays;
  if (c.scene.occluded(shadow_ray)) return {};
  if (medium == scene::kNone) return Spectrum(1.0f);
  rng::Stream stream(stream_key);
  survival *= static_cast<double>(stretch_survival(c.scene.medium(medium), shadow_ray));
  return c.scene.medium(medium).transmittance(shadow_ray, stream);
}

// The fraction of light that passes between vertex v and along `shadow_ray` from it, and the survival of
// weights.
template <EdgeContent kEdgeContent>
Spectrum visibility(const ConnectContext& c, const ScatterPoint& v, const Ray& shadow_ray,
                    std::uint64_t stream_key, double& survival) {
  survival = 1;
  if constexpr (kEdgeContent == EdgeContent::nothing) {
    ++c.sample_counts.rays;
    return c.scene.occluded(shadow_ray) ? Spectrum() : Spectrum(1.0f);
  } else {
    std::uint32_t medium = v.medium;
    if constexpr (kEdgeContent == EdgeContent::media) {
      if (c.has_media) medium = medium_towards(c, v, shadow_ray.direction);
      if (!c.passes_through) return through_one_medium(c, shadow_ray, medium, stream_key, survival);
    }
    return passing<kEdgeContent>(c.scene, shadow_ray, medium, rng::Stream(stream_key), c.sample_counts.rays,
                                 &survival);
  }
}

// The key of a sub-stream for tracking through media, from the vertex's block.
template <EdgeContent kEdgeContent, class SamplerT>
std::uint64_t passage_key(const VertexDraws<SamplerT>& draws) {
  if constexpr (kEdgeContent != EdgeContent::media) return 0;
  const Vec2 u = draws.sampler.draw_2d(draws.block + kTransmittance, false);
  return rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y), 0);
}
// The same; any number in a scene without media.
template <EdgeContent kEdgeContent, class SamplerT>
std::uint64_t passage_key(const ConnectContext& c, const VertexDraws<SamplerT>& draws) {
  return c.has_media ? passage_key<kEdgeContent>(draws) : 0;
}

}  // namespace candela::transport
