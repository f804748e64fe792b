// A Bsdf as the scene keeps it: a kind and its parameters, which may be textures. prepare() looks the
// textures up at a hit and resolves two-sidedness; what it returns is sampled and evaluated without looking
// at the scene again.
#pragma once

#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/hit.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class Bsdf {
 public:
  // From a description object of category "bsdf". Parameters mean what Mitsuba 3 documents; values that no
  // surface can have (reflectance outside [0, 1], an index of refraction not above 0, ...) are errors naming
  // file, line and property.
  static Result<Bsdf> build(const description::Object& object, TextureStore& textures);
  // Mitsuba's default of a shape without a bsdf: one-sided diffuse, reflectance 0.5.
  static Bsdf default_diffuse();

  // wo_world: unit, towards where the walk came from.
  Closure prepare(const SurfaceHit& hit, Vec3 wo_world) const;

  // Facts for SceneFeatures: of the side(s) there are.
  BsdfKind kind() const { return sides_[0].kind; }  // of the front
  BsdfKind back_kind() const {
    return sides_.back().kind;
  }                                                  // the same where one-sided, or two-sided with one child
  static std::string_view kind_name(BsdfKind kind);  // the plugin's name
  bool two_sided() const { return two_sided_; }
  bool any_delta() const;     // some side scatters by delta lobes
  bool all_delta() const;     // every side that scatters does so by delta lobes alone
  bool transmissive() const;  // light passes through
  bool black() const;         // every side has zero reflectance everywhere
  float max_albedo() const;   // an upper bound over the surface, channels and directions
  float min_roughness()
      const;  // the smallest alpha of its rough lobes; 0 for delta lobes, 1 for diffuse ones

 private:
  struct Side {
    BsdfKind kind = BsdfKind::diffuse;
    ColorTexture reflectance;  // diffuse: reflectance; others: specular_reflectance
    ColorTexture transmittance;
    ColorTexture eta, k;  // conductors
    FloatTexture alpha_u, alpha_v;
    float relative_eta = 1;  // dielectric: int_ior / ext_ior
    bool ggx = false;
    bool sample_visible = true;
    bool black() const;
  };
  static Result<Side> build_side(const description::Object& object, TextureStore& textures);

  std::vector<Side> sides_;  // front, and back where it differs; never empty
  bool two_sided_ = false;
};

}  // namespace candela::scene
