// The one door to scattering: the value, both densities, a sample, and the delta lobes of a vertex. Walks,
// mutations, techniques, merges, letters, aovs and the path tracer ask here: a change to how light scatters
// is made here. The oracle alone (path/evaluation.h) evaluates closures by itself, because it tests this.
//
// Directions are unit, in the world, and point away from the vertex. wo: towards the vertex before, of the
// walk; wi: where the walk goes on. Values include the cosine at wi on surfaces, and are zero for delta
// lobes. radiance: the walk comes from the eye; importance: from the light.
//
// Always inlined: GCC's limit on the growth of a unit otherwise stops inlining anywhere, at a cost of 1 % of
// the instructions of bdpt and pssmlt.
#pragma once

#include <cmath>

#include "worker/core/vec.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/hit.h"
#include "worker/scene/media/phase.h"
#include "worker/scene/turning_lobes.h"

namespace candela::transport {

using scene::SurfaceHit;
using scene::TransportMode;

// Factor that turns Closure's value, which knows the shading frame alone, into the adjoint bsdf of walks
// from the light if shading and geometric normals differ. wo: towards the light.
// [Veach 1997, Eq. 5.19]
[[gnu::always_inline]] inline float shading_correction(const SurfaceHit& hit, Vec3 wo, Vec3 wi) {
  if (hit.ng == hit.shading.n) return 1;
  const float above = std::abs(dot(wo, hit.shading.n) * dot(wi, hit.ng));
  const float below = std::abs(dot(wo, hit.ng) * dot(wi, hit.shading.n));
  return below > 0 ? above / below : 0.0f;
}

constexpr TransportMode other_mode(TransportMode mode) {
  return mode == TransportMode::radiance ? TransportMode::importance : TransportMode::radiance;
}

// Value and sample on a surface for walks of radiance that keep the hit, the closure, and wo in the frame of
// shading themselves: an object for them costs the path tracer 0.7 % of its instructions.
[[gnu::always_inline]] inline Spectrum radiance_value(const SurfaceHit& hit, const scene::Closure& closure,
                                                      Vec3 local_wo, Vec3 wi, float& pdf_solid_angle) {
  return closure.eval_pdf(local_wo, hit.shading.to_local(wi), TransportMode::radiance, pdf_solid_angle);
}
[[gnu::always_inline]] inline bool sample_radiance(const scene::Closure& closure, Vec3 local_wo, float u_lobe,
                                                   Vec2 u, scene::BsdfSample& out) {
  return closure.sample(local_wo, u_lobe, u, TransportMode::radiance, out);
}

// On a surface. The hit and the closure have to outlive it.
class SurfaceScattering {
 public:
  [[gnu::always_inline]] SurfaceScattering(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo)
      : SurfaceScattering(hit, closure, wo, hit.shading.to_local(wo)) {}
  // local_wo: wo in the frame of shading, as the closure was made with.
  [[gnu::always_inline]] SurfaceScattering(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo,
                                           Vec3 local_wo)
      : hit_(hit), closure_(closure), wo_(wo), local_wo_(local_wo) {}

  // A direction in both frames, for callers that ask for more than its value.
  struct Direction {
    Vec3 world, local;
  };
  [[gnu::always_inline]] Direction along(Vec3 wi) const { return {wi, hit_.shading.to_local(wi)}; }

  // pdf_solid_angle: of the walk going on along wi.
  [[gnu::always_inline]] Spectrum value(const Direction& wi, TransportMode mode,
                                        float& pdf_solid_angle) const {
    const Spectrum f = closure_.eval_pdf(local_wo_, wi.local, mode, pdf_solid_angle);
    return mode == TransportMode::radiance ? f : f * adjoint(wi.world);
  }
  [[gnu::always_inline]] Spectrum value(Vec3 wi, TransportMode mode, float& pdf_solid_angle) const {
    return value(along(wi), mode, pdf_solid_angle);
  }
  [[gnu::always_inline]] float pdf_solid_angle(Vec3 wi, TransportMode mode) const {
    return closure_.pdf_solid_angle(local_wo_, hit_.shading.to_local(wi), mode);
  }
  // The density of the walk the other way, which arrives along wi, going on along wo. mode: of this walk.
  [[gnu::always_inline]] float pdf_reverse_solid_angle(const Direction& wi, TransportMode mode) const {
    return closure_.pdf_solid_angle(wi.local, local_wo_, other_mode(mode));
  }
  // The same for a direction that sample() chose by a lobe that is not delta.
  [[gnu::always_inline]] float pdf_reverse_solid_angle(const scene::BsdfSample& sample,
                                                       TransportMode mode) const {
    return closure_.pdf_solid_angle(sample.wi, local_wo_, other_mode(mode));
  }

  // out.wi is in the frame of shading, and out.weight lacks adjoint(). u_lobe is read if chooses_lobe().
  [[gnu::always_inline]] bool sample(float u_lobe, Vec2 u, TransportMode mode, scene::BsdfSample& out) const {
    return closure_.sample(local_wo_, u_lobe, u, mode, out);
  }
  bool chooses_lobe() const { return closure_.chooses_lobe(); }
  Vec3 direction(const scene::BsdfSample& sample) const { return hit_.shading.to_world(sample.wi); }
  // The factor of a sample's weight in walks from the light.
  [[gnu::always_inline]] float adjoint(Vec3 wi) const { return shading_correction(hit_, wo_, wi); }

  // The delta lobes that turn light, with directions in the world. u_lobe, u: as turning_lobes() reads them.
  scene::TurningLobes delta_lobes(float u_lobe, Vec2 u, TransportMode mode) const {
    scene::TurningLobes lobes = scene::turning_lobes(closure_, local_wo_, u_lobe, u, mode);
    for (std::uint32_t i = 0; i < lobes.count; ++i) {
      scene::TurningLobe& lobe = lobes.lobes[i];
      lobe.wi = hit_.shading.to_world(lobe.wi);
      if (mode == TransportMode::importance) lobe.attenuation *= adjoint(lobe.wi);
    }
    return lobes;
  }

  // The value without adjoint(), and the part of it by diffuse lobes (Closure::eval_diffuse).
  struct Parts {
    Spectrum all, diffuse;
  };
  Parts parts(Vec3 wi, TransportMode mode, float glossy_below) const {
    const Vec3 local_wi = hit_.shading.to_local(wi);
    return {closure_.eval(local_wo_, local_wi, mode),
            closure_.eval_diffuse(local_wo_, local_wi, mode, glossy_below)};
  }

  // As Scene::sample_direct wants it: the normal on the side of wo, or zero if both sides scatter.
  [[gnu::always_inline]] Vec3 front() const {
    return closure_.scatters_through() ? Vec3{} : local_wo_.z < 0 ? -hit_.shading.n : hit_.shading.n;
  }

 private:
  const SurfaceHit& hit_;
  const scene::Closure& closure_;
  Vec3 wo_, local_wo_;
};

// In a medium without edits, which scatters radiance and importance alike. The phase function has to outlive
// it. Places that edits turn have a closure (TurnedScattering).
class MediumScattering {
 public:
  [[gnu::always_inline]] MediumScattering(const scene::Phase& phase, Vec3 wo) : phase_(phase), wo_(wo) {}

  // Per steradian, without the medium's sigma_s, which is in the throughput.
  [[gnu::always_inline]] float value(Vec3 wi) const { return phase_.eval(wo_, wi); }
  [[gnu::always_inline]] Spectrum value(Vec3 wi, TransportMode /*mode*/, float& pdf_solid_angle) const {
    pdf_solid_angle = phase_.pdf_solid_angle(wo_, wi);
    return Spectrum(phase_.eval(wo_, wi));
  }
  [[gnu::always_inline]] float pdf_solid_angle(Vec3 wi) const { return phase_.pdf_solid_angle(wo_, wi); }
  // The density of the walk the other way, which arrives along wi, going on along wo.
  [[gnu::always_inline]] float pdf_reverse_solid_angle(Vec3 wi) const {
    return phase_.pdf_solid_angle(wi, wo_);
  }
  // Returns the density of wi.
  [[gnu::always_inline]] float sample(Vec2 u, Vec3& wi) const { return phase_.sample(wo_, u, wi); }

 private:
  const scene::Phase& phase_;
  Vec3 wo_;
};

// In a medium whose light edits turn: a closure in directions of the world (scene/bsdfs/edited.h).
class TurnedScattering {
 public:
  TurnedScattering(const scene::Closure& closure, Vec3 wo) : closure_(closure), wo_(wo) {}

  Spectrum value(Vec3 wi, TransportMode mode, float& pdf_solid_angle) const {
    return closure_.eval_pdf(wo_, wi, mode, pdf_solid_angle);
  }
  float pdf_solid_angle(Vec3 wi, TransportMode mode) const { return closure_.pdf_solid_angle(wo_, wi, mode); }
  // The density of the walk the other way, which arrives along wi, going on along wo. mode: of this walk.
  float pdf_reverse_solid_angle(Vec3 wi, TransportMode mode) const {
    return closure_.pdf_solid_angle(wi, wo_, other_mode(mode));
  }
  bool chooses_lobe() const { return closure_.chooses_lobe(); }
  bool sample(float u_lobe, Vec2 u, TransportMode mode, scene::BsdfSample& out) const {
    return closure_.sample(wo_, u_lobe, u, mode, out);
  }

 private:
  const scene::Closure& closure_;
  Vec3 wo_;
};

}  // namespace candela::transport
