// A bsdf in a turned shading frame, as bump and normal maps leave it. Directions that lie on different sides
// of the two frames' planes exchange nothing, so that no light leaks through the surface; as Mitsuba has it.
//
// Flipping. Seen from behind the turned normal n there would be nothing to see: where the viewer's direction
// and n disagree about the side, n is mirrored to (-n.x, -n.y, n.z) [Schuessler et al. 2017]. Only the
// viewer's direction decides: wo in radiance mode, wi in importance mode, so that both modes speak of the
// same f. A walk from the light does not know the viewer yet and samples from both frames, evenly, where the
// light reaches both.
//
// Shadowing. Light that grazes the true surface is attenuated by a masking function whose roughness follows
// from n's slope, so that bumps do not end in hard edges [Estevez et al. 2019]. It depends on the light's
// direction alone; f is not reciprocal.
//
// Adjoint. The nested bsdf's cosine is that of the turned normal, so that in this frame
//   f(wo, wi) = g(wo', wi') |wi'.z / wi.z|
// with g the nested f. Importance mode gives f with its arguments exchanged; its albedo has no bound, as with
// all shading normals [Veach 1997, section 5.3].
#pragma once

#include <memory>
#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/delta_lobes.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"

namespace candela::scene {

class Bsdf;

// The nested bsdf in a shading frame turned by a bump or normal map; `frame` is in the local frame.
struct PerturbedClosure {
  const Closure* nested;
  Frame frame;
  float shadow_alpha2;  // squared roughness of the shadowing function; 0: none
  bool flips;           // the normal is mirrored for viewers who would see it from behind

  ClosureTraits traits() const;
};
Spectrum eval_pdf(const PerturbedClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const PerturbedClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const PerturbedClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);
Spectrum passthrough(const PerturbedClosure& p, Vec3 wo);
void delta_choices(const PerturbedClosure& p, Vec3 wo, TransportMode mode, LobeRange range, LobeChoices& out);

// Bump and normal maps as in Mitsuba 3.
struct PerturbedSurface {
  using ClosureType = PerturbedClosure;
  static constexpr std::string_view kPlugins[] = {"normalmap", "bumpmap"};

  std::unique_ptr<Bsdf> nested;
  bool bump = false;          // a displacement; else normals
  ColorTexture normals;       // (n + 1) / 2 in the shading frame
  FloatTexture displacement;  // along the normal, in units of the scene
  float scale = 1;            // of the displacement
  bool flips = true;          // flip_invalid_normals
  bool shadows = true;        // use_shadowing_function

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
  std::uint32_t arena_parts() const;
  template <class Visitor>
  void for_each_part(const Visitor& visit) const {
    visit(*nested);
  }
};

}  // namespace candela::scene
