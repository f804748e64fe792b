// A vertex of a subpath: a place where a walk scattered or could have, with all that is needed to connect it
// and merge it (ScatterPoint), and what a policy of weights keeps there (Vertex).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/hit.h"
#include "worker/scene/scene.h"
#include "worker/transport/mis/balance_power.h"
#include "worker/transport/scattering.h"

namespace candela::transport {

// Cosines below it count as it: no density may vanish where a ray did arrive.
inline constexpr float kMinCosine = 1e-9f;

// The hazard of a place in a medium, as weights count it: the mean of sigma_t over channels. Where a grid's
// value vanishes by interpolation nothing scatters; rounding may say otherwise, and beams get there.
inline float hazard_of(const Spectrum& sigma_t) {
  return std::max((sigma_t.r + sigma_t.g + sigma_t.b) * (1.0f / 3), 1e-30f);
}

enum class VertexKind : std::uint8_t { surface, medium };

// Directions of a higher density, per steradian, count as specular where photons alone are merged (PpmEye):
// photons in them are too few. It is that of the middle of a lobe of roughness 0.02 seen from above,
// 1 / (4 pi roughness^2).
inline constexpr float kSharpDensity = 200;

struct ScatterPoint {
  VertexKind kind = VertexKind::surface;
  // Has lobes that are not delta: may be connected to and merged with.
  bool connectible = false;
  // Set by Walk::scatter: by a delta lobe; by one, or in a direction of density above kSharpDensity.
  bool left_by_delta : 1 = false, left_sharply : 1 = false;
  // Light paths: the vertex before is a light that no walk can meet (a point, a direction).
  bool lit_by_delta : 1 = false;
  // In a medium: edits turn what it scatters, and `closure` is that.
  bool turned : 1 = false;
  // From the subpath's end point; passing a surface straight counts no edge.
  std::uint32_t edges = 0;
  // In a kept subpath the index of the vertex before; kNone: the end point.
  std::uint32_t parent = scene::kNone;
  // The medium that the walk arrived through; of a vertex in a medium, that medium.
  std::uint32_t medium = scene::kNone;
  SurfaceHit hit;
  Vec3 wo;     // unit, world, towards the vertex before
  Vec3 front;  // as Scene::sample_direct wants it: zero if both sides scatter
  // Throughput of the subpath up to here, without the scattering here. In a medium it includes sigma_s.
  Spectrum throughput;
  // The cosine between wo and ng; in a medium the hazard, the mean of sigma_t over channels.
  float arrival = 1;
  // The survival of the edge that the walk arrived by, as weights count it.
  float survival = 1;
  scene::Closure closure;  // of a surface, or `turned`

  bool on_surface() const { return kind == VertexKind::surface; }
  // The factor from a solid-angle density of arriving here along w (unit), at unit distance, to one per area
  // or volume.
  float density_factor(Vec3 w) const {
    return kind == VertexKind::medium ? arrival : std::max(std::abs(dot(w, hit.ng)), kMinCosine);
  }
};

// Block: that of a policy of weights (mis/); an unweighted vertex carries none.
template <class Block>
struct Vertex : ScatterPoint, Block::Densities {
  [[no_unique_address]] Block mis;
};
static_assert(sizeof(Vertex<NoBlock>) == sizeof(ScatterPoint));

// The scattering value of a walk that arrived against wo, along wi, and its density per solid angle of going
// on along wi: scattering.h's, whatever the vertex is.
[[gnu::always_inline]] inline Spectrum scatter_value(const scene::Scene& scene, const ScatterPoint& v,
                                                     Vec3 wo, Vec3 wi, TransportMode mode,
                                                     float& pdf_solid_angle) {
  if (v.kind == VertexKind::medium) {
    if (v.turned) [[unlikely]]
      return TurnedScattering(v.closure, wo).value(wi, mode, pdf_solid_angle);
    return MediumScattering(scene.medium(v.medium).phase(), wo).value(wi, mode, pdf_solid_angle);
  }
  return SurfaceScattering(v.hit, v.closure, wo).value(wi, mode, pdf_solid_angle);
}

// The density alone.
[[gnu::always_inline]] inline float pdf_scatter_solid_angle(const scene::Scene& scene, const ScatterPoint& v,
                                                            Vec3 wo, Vec3 wi, TransportMode mode) {
  if (v.kind == VertexKind::medium) {
    if (v.turned) [[unlikely]]
      return TurnedScattering(v.closure, wo).pdf_solid_angle(wi, mode);
    return MediumScattering(scene.medium(v.medium).phase(), wo).pdf_solid_angle(wi);
  }
  return SurfaceScattering(v.hit, v.closure, wo).pdf_solid_angle(wi, mode);
}

}  // namespace candela::transport
