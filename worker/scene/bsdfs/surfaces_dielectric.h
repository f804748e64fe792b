// Dielectric boundaries as the scene keeps them, beside the smooth one: rough, and thin. See surfaces.h.
#pragma once

#include "worker/scene/bsdfs/surfaces.h"

namespace candela::scene {

// Where the indices match within kMatchedIndex there is no boundary: light passes straight on.
struct RoughDielectricSurface {
  DielectricSurface boundary;
  FloatTexture alpha_u, alpha_v;
  bool ggx = false;
  bool sample_visible = true;
  // Below this difference from 1, facets deflect light by less than float directions resolve.
  static constexpr float kMatchedIndex = 1e-5f;
  bool matched() const;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

struct ThinDielectricSurface {
  DielectricSurface boundary;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
