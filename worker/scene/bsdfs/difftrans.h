// Mitsuba 0.6's diffuse transmitter: light leaves the other side in all directions alike, whichever side it
// came from. Nothing is reflected.
//
// f |cos theta_i| = transmittance / pi |cos theta_i| where wo and wi lie on different sides
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct DiffuseTransmitterClosure {
  Spectrum transmittance;

  ClosureTraits traits() const { return {.through = true}; }
};
Spectrum eval_pdf(const DiffuseTransmitterClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
bool sample(const DiffuseTransmitterClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out);

struct DiffuseTransmitterSurface {
  using ClosureType = DiffuseTransmitterClosure;
  static constexpr std::string_view kPlugins[] = {"difftrans"};

  ColorTexture transmittance;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
