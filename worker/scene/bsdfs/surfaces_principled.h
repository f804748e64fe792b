// The principled bsdf as the scene keeps it. See surfaces.h and principled.h.
#pragma once

#include "worker/scene/bsdfs/surfaces.h"

namespace candela::scene {

struct PrincipledSurface {
  ColorTexture base_color;
  FloatTexture roughness, anisotropic, metallic, spec_trans, spec_tint, sheen, sheen_tint, flatness,
      clearcoat, clearcoat_gloss;
  float eta = 1.5f;  // below over above
  float rate_diffuse = 1, rate_coat = 1, rate_specular = 1;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
