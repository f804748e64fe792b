// A vertex of a subpath: a place where a walk scattered or could have, with all that is needed to connect it,
// merge it, and know the densities of both directions in any measure.
#pragma once

#include <cmath>
#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/hit.h"
#include "worker/scene/scene.h"
#include "worker/transport/mis.h"

namespace candela::transport {

using scene::SurfaceHit;
using scene::TransportMode;

// Cosines below it count as it: no density may vanish where a ray did arrive.
inline constexpr float kLeastCosine = 1e-9f;

// Of importance mode, where shading normals differ from the geometric one: what makes the bsdf that a walk
// from the light needs out of what Closure gives, which knows the shading frame alone. wo: towards the light.
// [Veach 1997, Eq. 5.19]
inline float shading_correction(const SurfaceHit& hit, Vec3 wo, Vec3 wi) {
  if (hit.ng == hit.shading.n) return 1;
  const float above = std::abs(dot(wo, hit.shading.n) * dot(wi, hit.ng));
  const float below = std::abs(dot(wo, hit.ng) * dot(wi, hit.shading.n));
  return below > 0 ? above / below : 0.0f;
}

struct Vertex {
  enum class Kind : std::uint8_t { surface, medium };
  Kind kind = Kind::surface;
  // Has lobes that are not delta: may be connected to and merged with.
  bool connects = false;
  bool previous_connects = false;  // and so had the vertex before it, in the direction the walk took
  std::uint32_t edges = 0;         // from the subpath's end point; passing straight counts no edge
  std::uint32_t parent =
      scene::kNone;  // where subpaths are kept: index of the vertex before; kNone: end point
  std::uint32_t medium = scene::kNone;  // that the walk arrived through; of a vertex in it, its own
  SurfaceHit hit;
  Vec3 wo;                 // unit, world, towards the vertex before
  Vec3 front;              // as Scene::sample_direct wants it: zero where both sides scatter
  Spectrum throughput;     // of the subpath up to here, scattering here not included. In a medium sigma_s is
  float arrival = 1;       // cosine between wo and ng; in a medium the hazard, mean of sigma_t over channels
  scene::Closure closure;  // of a surface
  MisBlock mis;
  double pdf_arrival = 0;  // of the direction the walk arrived by, per solid angle, survival included
  double pdf_area = 0;     // with which the walk chose this vertex: area, or volume; survival included
  double back_area = 0;    // the reverse density is pdf_reverse (solid angle) times this; 1 at infinity
  double pdf_reverse = 0;  // set by Walk::scatter: towards the vertex before by a walk of the other kind that
                           // comes from the direction chosen; a delta lobe's: see Walk
  bool left_by_delta = false;  // set by Walk::scatter

  // What turns a solid-angle density of arriving here along w (unit), at unit distance, into one per area or
  // volume.
  float density_factor(Vec3 w) const {
    return kind == Kind::medium ? arrival : std::max(std::abs(dot(w, hit.ng)), kLeastCosine);
  }
};

// The scattering value, times the cosine at wi (world directions, away from the vertex), of a walk that
// arrived against wo, and its density per solid angle of going on along wi. radiance: a walk from the eye;
// importance: from the light. Zero for delta lobes.
inline Spectrum scatter_value(const scene::Scene& scene, const Vertex& v, Vec3 wo, Vec3 wi,
                              TransportMode mode, float& pdf_solid_angle) {
  if (v.kind == Vertex::Kind::medium) {
    pdf_solid_angle = scene.medium(v.medium).phase().pdf_solid_angle(wo, wi);
    return Spectrum(scene.medium(v.medium).phase().eval(wo, wi));
  }
  const Spectrum value =
      v.closure.eval_pdf(v.hit.shading.to_local(wo), v.hit.shading.to_local(wi), mode, pdf_solid_angle);
  return mode == TransportMode::radiance ? value : value * shading_correction(v.hit, wo, wi);
}

// The density alone.
inline float pdf_scatter_solid_angle(const scene::Scene& scene, const Vertex& v, Vec3 wo, Vec3 wi,
                                     TransportMode mode) {
  if (v.kind == Vertex::Kind::medium) return scene.medium(v.medium).phase().pdf_solid_angle(wo, wi);
  return v.closure.pdf_solid_angle(v.hit.shading.to_local(wo), v.hit.shading.to_local(wi), mode);
}

}  // namespace candela::transport
