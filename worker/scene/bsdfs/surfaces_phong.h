// Mitsuba 0.6's phenomenological bsdfs as the scene keeps them: phong and ward. See surfaces.h.
#pragma once

#include "worker/scene/bsdfs/surfaces.h"

namespace candela::scene {

// A diffuse and a specular colour. Where their largest values add up to more than 1, both are scaled down for
// the whole surface, as 0.6 does to conserve energy.
struct TwoColours {
  ColorTexture diffuse, specular;
  float scale = 1;
  Result<void> build(const description::Object& object, TextureStore& textures);
  // Returns the probability of sampling the specular one.
  float prepare(Vec2 uv, Spectrum& diffuse_here, Spectrum& specular_here) const;
  float max_albedo() const;
};

struct PhongSurface {
  TwoColours colours;
  FloatTexture exponent;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

struct WardSurface {
  TwoColours colours;
  FloatTexture alpha_u, alpha_v;
  WardVariant variant = WardVariant::balanced;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
