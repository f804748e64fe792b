// Where bump and normal maps turn the shading frame. Both are Mitsuba 3's.
#pragma once

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surfaces.h"
#include "worker/scene/hit.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

struct Perturbation {
  bool bump = false;          // a displacement; else normals
  ColorTexture normals;       // (n + 1) / 2 in the shading frame
  FloatTexture displacement;  // along the normal, in units of the scene
  float scale = 1;            // of the displacement
  bool flips = true;          // flip_invalid_normals
  bool shadows = true;        // use_shadowing_function

  // From a bsdf of plugin normalmap or bumpmap; its nested bsdf is the caller's part.
  Result<void> build(const description::Object& object, TextureStore& textures);
  // All of `out` but the nested closure.
  void prepare(const SurfaceHit& hit, PerturbedParameters& out) const;
};

}  // namespace candela::scene
