// Scattering in a medium as a closure, so that edits may turn it as they turn that of surfaces (edited.h).
// Directions are those of the world. A medium without edits has no closure: its phase function is asked.
#pragma once

#include <array>
#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"
#include "worker/scene/media/phase.h"

namespace candela::scene {

struct PhaseClosure {
  const Phase* phase;  // outlives the closure

  static ClosureTraits traits() { return {.through = true}; }
};
inline Spectrum eval_pdf(const PhaseClosure& c, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = c.phase->pdf_solid_angle(wo, wi);
  return Spectrum(c.phase->eval(wo, wi));
}
inline bool sample(const PhaseClosure& c, Vec3 wo, float /*u_lobe*/, Vec2 u, TransportMode /*mode*/,
                   BsdfSample& out) {
  out.pdf_solid_angle = c.phase->sample(wo, u, out.wi);
  out.weight = Spectrum(1);
  return true;
}

// A row of the list of kinds for the closure alone: no scene has it.
struct PhaseSurface {
  using ClosureType = PhaseClosure;
  static constexpr std::array<std::string_view, 0> kPlugins = {};

  static Result<void> build(const description::Object& object, const BuildContext& /*context*/) {
    return located("a phase function is no bsdf plugin", object, "");
  }
  static void prepare(const SurfaceHit& /*hit*/, bool /*below*/, Closure& out) { out.black = true; }
  static BsdfFacts facts() { return {}; }
};

}  // namespace candela::scene
