// Bsdfs as the transport layer sees them. A Bsdf belongs to the scene; at a hit it is prepared into a Closure
// (textures looked up, two-sidedness resolved), which is what gets sampled and evaluated, several times,
// without looking at the scene again. Kinds are a closed set (bsdfs/kinds.h), which nobody knows from here.
// Composite kinds (blends, bump maps) refer to further closures in a ClosureArena; a scene without them never
// touches the arena.
//
// All directions are in the local shading frame (z = shading normal), unit, pointing away from the surface.
// wo: towards where the walk came from; wi: where it goes on (sampled). In radiance mode wo points to the eye
// and light arrives along wi. Values include the cosine: f(wo, wi) |cos theta_i|.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>

#include "worker/core/vec.h"

namespace candela::scene {

// Quantity that flows along the walk: radiance for walks from the eye, importance for walks from lights.
// Refraction scales radiance by 1/eta^2 and importance not (Veach 1997, ch. 5).
enum class TransportMode : std::uint8_t { radiance, importance };

struct BsdfSample {
  Vec3 wi;
  Spectrum weight;            // f |cos theta_i| / pdf, or for delta lobes attenuation / prob
  float pdf_solid_angle = 0;  // of wi, over all lobes that are not delta; meaningless where delta
  float prob = 1;             // of a delta lobe: the discrete probability of its choice,
  float prob_reverse = 1;     // and of the same choice by a walk that comes along wi and leaves along wo
  bool delta = false;
  bool transmitted = false;
  // The delta lobe along -wo that passes as if nothing were there; implies transmitted.
  bool passthrough = false;
  // Relative index, wi's side over wo's side, for Russian roulette's radiance scale; 1 for reflection.
  float eta = 1;
};

// Facts of a closure that callers ask for before they sample or evaluate it.
struct ClosureTraits {
  bool purely_delta = false;  // has delta lobes alone
  bool has_delta = false;     // may have delta lobes, perhaps beside others
  bool reads_lobe = false;    // sample() reads u_lobe
  bool through = false;       // lobes that are not delta scatter light through the surface
  bool even = false;          // the density of lobes that are not delta is never above 1 per steradian
};

// Smallest usable density: below it, 1/pdf is unreliable. Rejecting such samples has no measurable effect.
inline constexpr float kMinDensity = 1e-30f;

// A bsdf at a hit. Each kind of closure C (bsdfs/<kind>.h) is a trivially copyable struct of parameters with
//   C::traits()
//   sample(c, wo, u_lobe, u, mode, out), eval_pdf(c, wo, wi, mode, pdf), passthrough(c, wo),
//   eval_diffuse(c, wo, wi, mode, glossy_below)
// of which the last three may be left out: eval_pdf and passthrough are then zero, and all of eval_pdf is
// diffuse. They mean what the members below do, for closures that are neither flipped nor black.
class Closure {
 public:
  bool flipped = false;  // a twosided bsdf hit from behind: directions are mirrored in z before use
  bool black = true;     // scatters nothing: a one-sided bsdf from behind, or zero reflectance everywhere

  // Makes this a closure of kind C, neither flipped nor black. These templates are defined in bsdfs/kinds.h.
  template <class C>
  void set(const C& closure);
  template <class C>
  bool is() const;
  // Precondition: is<C>().
  template <class C>
  const C& get() const;
  std::size_t kind() const { return kind_; }

  // f |cos theta_i|; zero for delta lobes.
  Spectrum eval(Vec3 wo, Vec3 wi, TransportMode mode) const;
  // Density of sample() choosing wi by its non-delta lobes.
  float pdf_solid_angle(Vec3 wo, Vec3 wi, TransportMode mode) const;
  // eval and pdf at once, as next event estimation needs them.
  Spectrum eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, float& pdf_solid_angle) const;
  // The part of eval() by lobes that are diffuse: all but lobes of a roughness (alpha, the larger one) below
  // `glossy_below`. Layers of an image ask for it; nobody else does.
  Spectrum eval_diffuse(Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) const;
  // False: absorbed or no valid direction.
  bool sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) const;
  // The fraction of the light along -wo that goes on straight, as if there were no surface: what a sample
  // with `passthrough` stands for. Light sources are seen through it by next event estimation.
  Spectrum passthrough(Vec3 wo) const;
  // sample() reads u_lobe.
  bool chooses_lobe() const { return traits_.reads_lobe; }
  // Lobes that are not delta send light through: emitters behind the surface count.
  bool scatters_through() const { return traits_.through && !black; }
  // Only delta lobes: next event estimation is pointless.
  bool purely_delta() const { return traits_.purely_delta; }
  // Specular continuation is possible.
  bool has_delta_lobes() const { return traits_.has_delta; }
  // No direction but those of delta lobes is of high density.
  bool even() const { return traits_.even; }

 private:
  static constexpr std::size_t kRoom = 88;

  std::uint8_t kind_ = 0;
  ClosureTraits traits_;
  alignas(8) std::byte room_[kRoom];
};

static_assert(sizeof(Closure) <= 96);

// Room for the parts of the composite closures at one hit. Bsdf::build sees to it that no bsdf needs more.
class ClosureArena {
 public:
  static constexpr std::uint32_t kParts = 24;
  ClosureArena() : used_(0) {}  // room_ is not initialized: only parts that are made cost anything
  void clear() { used_ = 0; }
  Closure& make() { return *new (room_ + sizeof(Closure) * used_++) Closure; }

 private:
  alignas(Closure) unsigned char room_[kParts * sizeof(Closure)];
  std::uint32_t used_;
};

}  // namespace candela::scene
