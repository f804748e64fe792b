// Plastics as the scene keeps them: a diffuse base under a smooth or rough dielectric coat. See surfaces.h.
#pragma once

#include <memory>

#include "worker/scene/bsdfs/rough_transmittance.h"
#include "worker/scene/bsdfs/surfaces.h"

namespace candela::scene {

// What both have.
struct CoatedBase {
  ColorTexture diffuse, specular;
  float eta = 1;
  bool nonlinear = false;
  double internal_reflectance = 0;  // of the coat, for diffuse light from inside
  Result<void> build(const description::Object& object, TextureStore& textures);
  // What is left of `diffuse` after any number of reflections inside, over eta^2; and the specular part's
  // share of the two colours. False: both are black.
  bool prepare(Vec2 uv, Spectrum& base, Spectrum& coat, float& specular_share) const;
  float max_albedo() const;
};

struct PlasticSurface {
  CoatedBase base;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

struct RoughPlasticSurface {
  CoatedBase base;
  float alpha = 0.1f;
  bool ggx = false;
  bool sample_visible = true;
  std::shared_ptr<const RoughTransmittance> coat;
  Result<void> build(const description::Object& object, TextureStore& textures, RoughTransmittances& coats);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
