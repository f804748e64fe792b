#include "worker/scene/bsdfs/perturbation.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/surface_support.h"

namespace candela::scene {
namespace {

// The normal of the displaced surface p + h n, in the shading frame, not of unit length. The derivative of n
// itself is left out [Blinn 1978]: dp/du becomes its part in the tangent plane plus n dh/du. Double: the
// product of two tangents of 1e-20 is no float.
Vec3d displaced_normal(const SurfaceHit& hit, double dh_du, double dh_dv) {
  const Vec3d s(hit.shading.s), t(hit.shading.t), dp_du(hit.dp_du), dp_dv(hit.dp_dv);
  const Vec3d n =
      cross(Vec3d{dot(s, dp_du), dot(t, dp_du), dh_du}, Vec3d{dot(s, dp_dv), dot(t, dp_dv), dh_dv});
  return dot(n, Vec3d(hit.shading.to_local(hit.ng))) < 0 ? -n : n;
}

// The frame around n whose s is as near to x as can be.
Frame frame_around(Vec3d n) {
  const double l = length(n);
  n = l > 0 && std::isfinite(l) ? n / l : Vec3d{0, 0, 1};
  const Vec3d s = Vec3d{1, 0, 0} - n * n.x;
  const double sl = length(s);
  Frame frame;
  frame.n = Vec3(n);
  frame.s = sl > 1e-10 ? Vec3(s / sl) : Vec3{0, 1, 0};
  frame.t = cross(frame.n, frame.s);
  return frame;
}

}  // namespace

Result<void> Perturbation::build(const description::Object& object, TextureStore& textures) {
  bump = object.plugin == "bumpmap";
  flips = object.get_bool("flip_invalid_normals", true);
  shadows = object.get_bool("use_shadowing_function", true);
  if (!bump) {
    if (!given(object, "normalmap"))
      return located("a normalmap needs a texture of normals", object, "normalmap");
    CANDELA_ASSIGN(normals, textures.color(object, "normalmap", Spectrum(0.5f, 0.5f, 1)));
    return {};
  }
  const description::Child* map = nullptr;
  for (const description::Child& child : object.children) {
    if (child.object->category != "texture") continue;
    if (map != nullptr) return located("bumpmap holds one texture, not two", *child.object, child.slot);
    map = &child;
  }
  if (map == nullptr) return located("bumpmap holds a texture, the displacement", object, "");
  CANDELA_ASSIGN(displacement, textures.nested_number(map->object));
  scale = static_cast<float>(object.get_number("scale", 1));
  if (!std::isfinite(scale)) return located("the scale is too large", object, "scale");
  return {};
}

void Perturbation::prepare(const SurfaceHit& hit, PerturbedParameters& out) const {
  Vec3d n;
  if (bump) {
    const Vec2 gradient = displacement.gradient(hit.uv);
    const auto k = static_cast<double>(scale);
    n = displaced_normal(hit, k * static_cast<double>(gradient.x), k * static_cast<double>(gradient.y));
  } else {
    const Spectrum c = normals.eval(hit.uv);
    n = {2 * static_cast<double>(c.r) - 1, 2 * static_cast<double>(c.g) - 1,
         2 * static_cast<double>(c.b) - 1};
  }
  out.frame = frame_around(n);
  out.flips = flips;
  const Vec3 unit = out.frame.n;
  const float across2 = unit.x * unit.x + unit.y * unit.y;
  // [Estevez et al. 2019, Listing 15-1]: alpha^2 = tan^2 / 8, at most 1
  out.shadow_alpha2 = !shadows || across2 == 0
                          ? 0.0f
                          : (across2 < 8 * unit.z * unit.z ? across2 / (8 * unit.z * unit.z) : 1.0f);
}

}  // namespace candela::scene
