// Bsdfs as the transport layer sees them. A Bsdf belongs to the scene; at a hit it is prepared into a Closure
// (textures looked up, two-sidedness resolved), which is what gets sampled and evaluated, several times,
// without looking at the scene again. Kinds are a closed set dispatched by switch.
//
// All directions are in the local shading frame (z = shading normal), unit, pointing away from the surface.
// wo: towards where the walk came from; wi: where it goes on (sampled). In radiance mode wo points to the eye
// and light arrives along wi. Values include the cosine: f(wo, wi) |cos theta_i|.
#pragma once

#include <cstdint>

#include "worker/core/vec.h"

namespace candela::scene {

// What flows along the walk: radiance for walks from the eye, importance for walks from lights. Refraction
// scales radiance by 1/eta^2 and importance not (Veach 1997, ch. 5).
enum class TransportMode : std::uint8_t { radiance, importance };

struct BsdfSample {
  Vec3 wi;
  Spectrum weight;            // f |cos theta_i| / pdf, or for delta lobes attenuation / prob
  float pdf_solid_angle = 0;  // of wi; meaningless where delta
  bool delta = false;
  bool transmitted = false;
  float eta = 1;  // relative index along wi's side over wo's side: for Russian roulette's radiance scale; 1
                  // for reflection
};

enum class BsdfKind : std::uint8_t { diffuse, dielectric, conductor, roughconductor };

struct DiffuseParameters {
  Spectrum reflectance;
};
struct DielectricParameters {
  Spectrum reflectance, transmittance;  // specular_reflectance, specular_transmittance
  float eta;                            // int_ior / ext_ior; the normal points to the outside
};
struct ConductorParameters {
  Spectrum reflectance, eta, k;  // relative to the outside medium
};
struct RoughConductorParameters {
  Spectrum reflectance, eta, k;
  float alpha_u, alpha_v;
  bool ggx;  // else Beckmann
  bool sample_visible;
};

class Closure {
 public:
  Closure() : diffuse() {}

  BsdfKind kind = BsdfKind::diffuse;
  bool flipped = false;  // a twosided bsdf hit from behind: directions are mirrored in z before use
  bool black = false;    // scatters nothing: a one-sided bsdf from behind, or zero reflectance everywhere
  union {
    DiffuseParameters diffuse;
    DielectricParameters dielectric;
    ConductorParameters conductor;
    RoughConductorParameters rough_conductor;
  };

  // f |cos theta_i|; zero for delta lobes.
  Spectrum eval(Vec3 wo, Vec3 wi, TransportMode mode) const;
  // Density of sample() choosing wi by its non-delta lobes.
  float pdf_solid_angle(Vec3 wo, Vec3 wi, TransportMode mode) const;
  // eval and pdf at once, as next event estimation needs them.
  Spectrum eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, float& pdf_solid_angle) const;
  // False: absorbed or no valid direction.
  bool sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) const;
  // sample() reads u_lobe.
  bool chooses_lobe() const { return kind == BsdfKind::dielectric; }
  // Only delta lobes: next event estimation is pointless.
  bool purely_delta() const { return kind == BsdfKind::dielectric || kind == BsdfKind::conductor; }
};

}  // namespace candela::scene
