// Mitsuba 0.6's diffuse transmitter: light leaves the other side in all directions alike, whichever side it
// came from. Candela's addition is a part that is reflected in all directions alike, as pbrt's material
// diffusetransmission has it.
//
// f |cos theta_i| = transmittance / pi |cos theta_i| where wo and wi lie on different sides
// f |cos theta_i| = reflectance / pi |cos theta_i| where they lie on one side
#pragma once

#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct DiffuseTransmitterClosure {
  Spectrum transmittance, reflectance;
  float prob_through;  // of sampling the transmission

  ClosureTraits traits() const {
    return {.reads_lobe = prob_through > 0 && prob_through<1, .through = prob_through> 0, .even = true};
  }
};
Spectrum eval_pdf(const DiffuseTransmitterClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
bool sample(const DiffuseTransmitterClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out);

struct DiffuseTransmitterSurface {
  using ClosureType = DiffuseTransmitterClosure;
  static constexpr std::string_view kPlugins[] = {"difftrans"};

  // If textures add up to more than 1 in a channel, the transmittance is 1 - reflectance.
  ColorTexture transmittance, reflectance;

  Result<void> build(const description::Object& object, const BuildContext& context);
  void prepare(const SurfacePoint& at, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
