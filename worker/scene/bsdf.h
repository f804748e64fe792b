// Bsdfs as the transport layer sees them. A Bsdf belongs to the scene; at a hit it is prepared into a Closure
// (textures looked up, two-sidedness resolved), which is what gets sampled and evaluated, several times,
// without looking at the scene again. Kinds are a closed set dispatched by switch. Composite kinds (blends,
// bump maps) refer to further closures in a ClosureArena; a scene without them never touches the arena.
//
// All directions are in the local shading frame (z = shading normal), unit, pointing away from the surface.
// wo: towards where the walk came from; wi: where it goes on (sampled). In radiance mode wo points to the eye
// and light arrives along wi. Values include the cosine: f(wo, wi) |cos theta_i|.
#pragma once

#include <cstdint>
#include <new>

#include "worker/core/vec.h"

namespace candela::scene {

// What flows along the walk: radiance for walks from the eye, importance for walks from lights. Refraction
// scales radiance by 1/eta^2 and importance not (Veach 1997, ch. 5).
enum class TransportMode : std::uint8_t { radiance, importance };

struct BsdfSample {
  Vec3 wi;
  Spectrum weight;            // f |cos theta_i| / pdf, or for delta lobes attenuation / prob
  float pdf_solid_angle = 0;  // of wi, over all lobes that are not delta; meaningless where delta
  float prob = 1;             // of a delta lobe: the discrete probability of its choice,
  float prob_reverse = 1;     // and of the same choice by a walk that comes along wi and leaves along wo
  bool delta = false;
  bool transmitted = false;
  bool straight =
      false;      // the delta lobe along -wo that passes as if nothing were there; implies transmitted
  float eta = 1;  // relative index along wi's side over wo's side: for Russian roulette's radiance scale; 1
                  // for reflection
};

enum class BsdfKind : std::uint8_t {
  diffuse,
  dielectric,
  conductor,
  roughconductor,
  null,
  phong,
  ward,
  principled,
  roughdielectric,
  thindielectric,
  plastic,
  roughplastic,
  // Composite ones.
  blend,
  perturbed
};
constexpr std::uint32_t bit(BsdfKind kind) {
  return 1u << static_cast<unsigned>(kind);
}
// Kinds of delta lobes alone; kinds whose sample() reads u_lobe.
inline constexpr std::uint32_t kDeltaKinds = bit(BsdfKind::dielectric) | bit(BsdfKind::conductor) |
                                             bit(BsdfKind::null) | bit(BsdfKind::thindielectric);
inline constexpr std::uint32_t kLobeKinds =
    bit(BsdfKind::dielectric) | bit(BsdfKind::phong) | bit(BsdfKind::ward) | bit(BsdfKind::principled) |
    bit(BsdfKind::roughdielectric) | bit(BsdfKind::thindielectric) | bit(BsdfKind::plastic) |
    bit(BsdfKind::roughplastic) | bit(BsdfKind::blend);
inline constexpr std::uint32_t kCompositeKinds = bit(BsdfKind::blend) | bit(BsdfKind::perturbed);
// Kinds that may scatter, not only refract, through the surface.
inline constexpr std::uint32_t kThroughKinds =
    kCompositeKinds | bit(BsdfKind::principled) | bit(BsdfKind::roughdielectric);

class Closure;
class RoughTransmittance;

// Densities below it have no inverse to trust; no sample of any number is lost by it.
inline constexpr float kLeastDensity = 1e-30f;

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
struct PhongParameters {
  Spectrum diffuse, specular;
  float exponent;
  float prob_specular;  // of sampling the lobe
};
enum class WardVariant : std::uint8_t { ward, ward_duer, balanced };
struct WardParameters {
  Spectrum diffuse, specular;
  float alpha_u, alpha_v;
  float prob_specular;
  WardVariant variant;
};
// Mitsuba's parameters, combined; see principled.h.
struct PrincipledParameters {
  Spectrum base;
  float alpha_u, alpha_v, eta;
  float diffuse;            // weight of the diffuse part, (1 - metallic) (1 - spec_trans)
  float transmission;       // weight of refraction, (1 - metallic) spec_trans
  float f0_base, f0_white;  // at normal incidence Schlick's terms reflect base * f0_base + f0_white
  float f90, f_dielectric;  // at grazing incidence they reflect f90; weight of the dielectric Fresnel term
  float sheen_base, sheen_white;  // sheen is base * sheen_base + sheen_white
  float roughness, flatness;
  float coat, coat_alpha, coat_norm;
  float rate_diffuse, rate_coat, rate_specular;  // of sampling these, to be divided by their sum
};
struct RoughDielectricParameters {
  Spectrum reflectance, transmittance;
  float eta;  // as of DielectricParameters
  float alpha_u, alpha_v;
  bool ggx;
  bool sample_visible;
};
struct PlasticParameters {
  Spectrum diffuse;   // of the base, seen through the coat: see plastic.h
  Spectrum specular;  // colour of the coat's reflection
  float eta;
  float specular_share;  // steers sampling to the coat
};
struct RoughPlasticParameters {
  Spectrum diffuse, specular;
  float eta, alpha;
  float specular_share;
  bool ggx;
  bool sample_visible;
  const RoughTransmittance* coat;
};

// (1 - weight) of `first`, weight of `second`. A mask is a blend of nothing and its bsdf by opacity.
struct BlendParameters {
  const Closure* first;
  const Closure* second;
  float weight;
};
// The nested bsdf in a shading frame turned by a bump or normal map; `frame` is in the local frame.
struct PerturbedParameters {
  const Closure* nested;
  Frame frame;
  float shadow_alpha2;  // squared roughness of the shadowing function; 0: none
  bool flips;           // the normal is mirrored for viewers who would see it from behind
};

class Closure {
 public:
  Closure() : diffuse() {}

  BsdfKind kind = BsdfKind::diffuse;
  bool flipped = false;  // a twosided bsdf hit from behind: directions are mirrored in z before use
  bool black = false;    // scatters nothing: a one-sided bsdf from behind, or zero reflectance everywhere
  union {
    DiffuseParameters diffuse;
    DielectricParameters dielectric;  // also of thindielectric
    ConductorParameters conductor;
    RoughConductorParameters rough_conductor;
    PhongParameters phong;
    WardParameters ward;
    PrincipledParameters principled;
    RoughDielectricParameters rough_dielectric;
    PlasticParameters plastic;
    RoughPlasticParameters rough_plastic;
    BlendParameters blend;
    PerturbedParameters perturbed;
  };

  // f |cos theta_i|; zero for delta lobes.
  Spectrum eval(Vec3 wo, Vec3 wi, TransportMode mode) const;
  // Density of sample() choosing wi by its non-delta lobes.
  float pdf_solid_angle(Vec3 wo, Vec3 wi, TransportMode mode) const;
  // eval and pdf at once, as next event estimation needs them.
  Spectrum eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, float& pdf_solid_angle) const;
  // False: absorbed or no valid direction.
  bool sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) const;
  // The fraction of the light along -wo that goes on straight, as if there were no surface: what a sample
  // with `straight` stands for. Light sources are seen through it by next event estimation.
  Spectrum straight(Vec3 wo) const;
  // sample() reads u_lobe.
  bool chooses_lobe() const {
    return (kLobeKinds & bit(kind)) != 0 ||
           (kind == BsdfKind::perturbed && (perturbed.flips || perturbed.nested->chooses_lobe()));
  }
  // Lobes that are not delta send light through: emitters behind the surface count.
  bool scatters_through() const { return (kThroughKinds & bit(kind)) != 0 && parts_scatter_through(); }
  // Only delta lobes: next event estimation is pointless.
  bool purely_delta() const {
    return (kDeltaKinds & bit(kind)) != 0 || ((kCompositeKinds & bit(kind)) != 0 && parts_purely_delta());
  }

 private:
  // Of every kind but diffuse, neither black nor flipped.
  [[gnu::noinline]] Spectrum eval_pdf_by_kind(Vec3 wo, Vec3 wi, TransportMode mode,
                                              float& pdf_solid_angle) const;
  [[gnu::noinline]] bool sample_by_kind(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
                                        BsdfSample& out) const;
  bool parts_purely_delta() const;
  bool parts_scatter_through() const;
};

static_assert(sizeof(Closure) <= 96);

// Room for the parts of the composite closures at one hit. Bsdf::build sees to it that no bsdf needs more.
class ClosureArena {
 public:
  static constexpr std::uint32_t kParts = 24;
  ClosureArena() : used_(0) {}  // the room itself stays as it is: nobody pays for what is not used
  void clear() { used_ = 0; }
  Closure& make() { return *new (room_ + sizeof(Closure) * used_++) Closure; }

 private:
  alignas(Closure) unsigned char room_[kParts * sizeof(Closure)];
  std::uint32_t used_;
};

}  // namespace candela::scene
