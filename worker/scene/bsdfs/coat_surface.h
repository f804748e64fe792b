// The parameters and the base that all dielectric layers share, for `coating` and `roughcoating`.
#pragma once

#include <memory>
#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"

namespace candela::scene {

class Bsdf;

// The part of a layer's closure that does not depend on the layer's roughness.
struct CoatClosure {
  const Closure* below;
  Spectrum specular;    // color of the layer's reflection
  Spectrum absorption;  // sigma_a thickness
  float eta;            // of the layer over outside
  float share;          // steers sampling to the layer's reflection
};

struct CoatSurface {
  std::unique_ptr<Bsdf> base;
  ColorTexture specular, sigma_a;
  float thickness = 1;
  float eta = 1;

  // Reads the base and the layer. Errors name `plugin`, the file and the line.
  Result<void> build_coat(std::string_view plugin, const description::Object& object,
                          const BuildContext& context);
  // Evaluates the layer at the hit, and prepares the base along the refracted direction in the arena.
  void prepare_coat(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, CoatClosure& out) const;
  // True if neither the layer nor the base scatters light that arrives along wo. The layer has as many sides
  // as its base.
  bool is_black(const CoatClosure& layer, Vec3 wo) const;

  std::uint32_t arena_parts() const;
  template <class Visitor>
  void for_each_part(const Visitor& visit) const {
    visit(*base);
  }
};

}  // namespace candela::scene
