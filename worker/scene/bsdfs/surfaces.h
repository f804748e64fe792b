// The plain bsdfs as the scene keeps them: parameters that may be textures. Each surface builds itself from a
// description object, fills in a Closure at a point, and states facts about itself.
//
// build: parameters mean what Mitsuba 3 documents; values that no surface can have are errors naming file,
// line and property. prepare: uv of the hit; `below`: wo lies under the surface (local z < 0). black is false
// already.
#pragma once

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

// Of a bsdf with all its parts and sides.
struct BsdfFacts {
  bool delta = false;         // has delta lobes (straight ones aside)
  bool smooth = false;        // has lobes that are not delta
  bool transmissive = false;  // light passes through by refraction or scattering
  bool straight = false;      // light passes straight on
  bool two_sided = false;
  bool perturbs = false;        // turns the shading frame: bump and normal maps
  bool reads_partials = false;  // prepare() reads SurfaceHit::dp_du and dp_dv
  float max_albedo = 0;     // an upper bound over the surface, channels and directions; 0: black everywhere
  float min_roughness = 1;  // the smallest alpha of its rough lobes; 0 for delta lobes, 1 for diffuse ones

  bool black() const { return max_albedo == 0; }
  void forget_lobes();                // as if it were black
  void join(const BsdfFacts& other);  // facts of a bsdf that has both as parts
};

struct DiffuseSurface {
  ColorTexture reflectance;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

struct DielectricSurface {
  ColorTexture reflectance, transmittance;
  float eta = 1;  // int_ior / ext_ior
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

struct ConductorSurface {
  ColorTexture reflectance, eta, k;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

struct RoughConductorSurface {
  ConductorSurface metal;
  FloatTexture alpha_u, alpha_v;
  bool ggx = false;
  bool sample_visible = true;
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

struct NullSurface {
  Result<void> build(const description::Object& object, TextureStore& textures);
  void prepare(Vec2 uv, bool below, Closure& out) const;
  BsdfFacts facts() const;
};

}  // namespace candela::scene
