// The parts that surfaces of all kinds share. A surface is a bsdf as the scene keeps it: parameters that may
// be textures. It builds itself from a description, fills in a Closure at a point, and states facts about
// itself:
//
//   ClosureType, kPlugins   the closure it prepares, if that is its own; the names in scene files
//   build(object, context)  parameters mean what Mitsuba 3 documents; values that no surface can have are
//                           errors naming file, line and property
//   prepare                 of plain surfaces: (at, below, out); `below`: wo lies under the surface
//                           of composites: (hit, wo, arena, out)
//   facts()                 see BsdfFacts
//
// A composite has further bsdfs as parts, and two functions more: for_each_part(visitor), and arena_parts(),
// the number of closures that prepare() may make in the arena.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class RoughTransmittances;

// Facts of a bsdf with all its parts and sides.
struct BsdfFacts {
  bool delta = false;         // has delta lobes (straight ones aside)
  bool smooth = false;        // has lobes that are not delta
  bool transmissive = false;  // light passes through by refraction or scattering
  bool passthrough = false;   // light passes straight on
  bool two_sided = false;
  bool perturbs = false;        // turns the shading frame: bump and normal maps
  bool reads_partials = false;  // prepare() reads SurfaceHit::dp_du and dp_dv
  // An upper bound over the surface, channels and directions; 0: black everywhere.
  float max_albedo = 0;
  // The smallest alpha of its rough lobes; 0 for delta lobes, 1 for diffuse ones.
  float min_roughness = 1;

  bool black() const { return max_albedo == 0; }
  void forget_lobes();                // as if it were black
  void join(const BsdfFacts& other);  // facts of a bsdf that has both as parts
};

// All that build() reads beside the description.
struct BuildContext {
  TextureStore& textures;
  RoughTransmittances& coats;  // tables that the bsdfs of a scene share as they share images
  int depth = 0;               // of nesting
};

// An error at the property or child `property` of `object`, or at the object where it has none.
Error located(std::string message, const description::Object& object, std::string_view property);
// A number for messages, without trailing zeros.
std::string shown(float v);
bool given(const description::Object& object, std::string_view property);

// A color between 0 and 1: more would make light.
Result<ColorTexture> read_reflectance(const description::Object& object, TextureStore& textures,
                                      std::string_view name, float otherwise);
// A weight between 0 and 1.
Result<FloatTexture> read_fraction(const description::Object& object, TextureStore& textures,
                                   std::string_view name, float otherwise);
// int_ior / ext_ior, from 0.001 to 1000.
Result<float> read_relative_eta(const description::Object& object, double int_otherwise,
                                double ext_otherwise);

// alpha or alpha_u and alpha_v, distribution and sample_visible, as all rough bsdfs have them.
struct RoughnessParameters {
  FloatTexture alpha_u, alpha_v;
  bool ggx = false;
  bool sample_visible = true;
};
Result<RoughnessParameters> read_roughness(const description::Object& object, TextureStore& textures);
// Mitsuba's minimum roughness: below it the lobe is narrower than float directions resolve.
inline constexpr float kMinAlpha = 1e-4f;

// The bsdfs that a composite holds. It needs `min` to `max` of them.
Result<std::vector<description::ObjectPtr>> nested_bsdfs(const description::Object& object, std::size_t min,
                                                         std::size_t max);

}  // namespace candela::scene
