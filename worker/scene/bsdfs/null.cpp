#include "worker/scene/bsdfs/null.h"

#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {

bool sample(const NullClosure& /*p*/, Vec3 wo, float /*u_lobe*/, Vec2 /*u*/, TransportMode /*mode*/,
            BsdfSample& out) {
  out.wi = -wo;
  out.weight = Spectrum(1);
  out.delta = true;
  out.transmitted = true;
  out.passthrough = true;
  return true;
}

Spectrum passthrough(const NullClosure& /*p*/, Vec3 /*wo*/) {
  return Spectrum(1);
}

Result<void> NullSurface::build(const description::Object& /*object*/, const BuildContext& /*context*/) {
  return {};
}

void NullSurface::prepare(const SurfacePoint& /*at*/, bool /*below*/, Closure& out) const {
  out.set(NullClosure{});
}

BsdfFacts NullSurface::facts() const {
  return {.passthrough = true, .max_albedo = 1};
}

}  // namespace candela::scene
