#include "worker/scene/bsdfs/perturbed.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::scene {
namespace {

Vec3 mirrored(Vec3 v) {
  return {v.x, v.y, -v.z};
}

// The frame, or the one around the mirrored normal: with M the mirroring in z, s' = M s, t' = M t, n' = -M n.
Vec3 to_turned(const PerturbedClosure& p, Vec3 v, bool mirror) {
  if (!mirror) return p.frame.to_local(v);
  const Vec3 w = p.frame.to_local(mirrored(v));
  return {w.x, w.y, -w.z};
}
Vec3 from_turned(const PerturbedClosure& p, Vec3 v, bool mirror) {
  if (!mirror) return p.frame.to_world(v);
  return mirrored(p.frame.to_world({v.x, v.y, -v.z}));
}

bool mirrors(const PerturbedClosure& p, Vec3 viewer) {
  return p.flips && !(viewer.z * dot(viewer, p.frame.n) > 0);
}
// The direction lies on the same side of both planes.
bool agrees(const PerturbedClosure& p, Vec3 v, bool mirror) {
  return v.z * to_turned(p, v, mirror).z > 0;
}

float shadowing(const PerturbedClosure& p, Vec3 light) {
  if (p.shadow_alpha2 == 0) return 1;
  const float z = std::abs(light.z);
  const float across2 = light.x * light.x + light.y * light.y;
  return 2 * z / (z + std::sqrt(z * z + p.shadow_alpha2 * across2));
}

// The factor from the nested bsdf's adjoint to this one's. Both directions agree. It stays finite at grazing.
float adjoint(Vec3 wo, Vec3 turned_wo, Vec3 wi, Vec3 turned_wi) {
  return std::abs(turned_wo.z * wi.z) /
         (std::max(std::abs(wo.z), 1e-6f) * std::max(std::abs(turned_wi.z), 1e-6f));
}

// The nested bsdf in one of the two frames.
Spectrum within(const PerturbedClosure& p, bool mirror, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  pdf = 0;
  const Vec3 turned_wo = to_turned(p, wo, mirror);
  const Vec3 turned_wi = to_turned(p, wi, mirror);
  if (!(turned_wo.z * wo.z > 0 && turned_wi.z * wi.z > 0)) return {};
  const Spectrum value = p.nested->eval_pdf(turned_wo, turned_wi, mode, pdf);
  return mode == TransportMode::radiance ? value : value * adjoint(wo, turned_wo, wi, turned_wi);
}

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

ClosureTraits PerturbedClosure::traits() const {
  return {.purely_delta = nested->purely_delta(),
          .has_delta = true,  // perhaps
          .reads_lobe = flips || nested->chooses_lobe(),
          .through = nested->scatters_through(),
          .even = nested->even()};
}

Spectrum eval_pdf(const PerturbedClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  if (mode == TransportMode::radiance) return within(p, mirrors(p, wo), wo, wi, mode, pdf) * shadowing(p, wi);
  const bool mirror = mirrors(p, wi);
  const Spectrum value = within(p, mirror, wo, wi, mode, pdf) * shadowing(p, wo);
  if (p.flips && agrees(p, wo, !mirror)) {
    float other = 0;
    static_cast<void>(within(p, !mirror, wo, wi, mode, other));
    pdf = agrees(p, wo, mirror) ? 0.5f * (pdf + other) : other;
  }
  return value;
}

Spectrum eval_diffuse(const PerturbedClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  const bool to_eye = mode == TransportMode::radiance;
  const bool mirror = mirrors(p, to_eye ? wo : wi);
  const Vec3 turned_wo = to_turned(p, wo, mirror);
  const Vec3 turned_wi = to_turned(p, wi, mirror);
  if (!(turned_wo.z * wo.z > 0 && turned_wi.z * wi.z > 0)) return {};
  const Spectrum value = p.nested->eval_diffuse(turned_wo, turned_wi, mode, glossy_below);
  return to_eye ? value * shadowing(p, wi) : value * adjoint(wo, turned_wo, wi, turned_wi) * shadowing(p, wo);
}

bool sample(const PerturbedClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  const bool to_eye = mode == TransportMode::radiance;
  const bool both = !to_eye && p.flips && agrees(p, wo, false) && agrees(p, wo, true);
  bool mirror = to_eye ? mirrors(p, wo) : p.flips && agrees(p, wo, true);
  if (both) {
    mirror = u_lobe < 0.5f;
    u_lobe = mirror ? 2 * u_lobe : 2 * u_lobe - 1;
  }
  if (!agrees(p, wo, mirror)) return false;
  if (!p.nested->sample(to_turned(p, wo, mirror), u_lobe, u, mode, out)) return false;
  if (out.passthrough) {
    out.wi = -wo;
    const bool tossed = p.flips && agrees(p, wo, false) && agrees(p, wo, true);  // by walks from the light
    if (to_eye) {
      if (tossed) out.prob_reverse *= 0.5f;
      return true;
    }
    if (mirror != mirrors(p, wo))
      return false;  // the viewer, who looks along the light, sees the other frame
    if (tossed) {
      out.weight *= 2;
      out.prob *= 0.5f;
    }
    return true;
  }
  out.wi = normalize(from_turned(p, out.wi, mirror));
  if (!agrees(p, out.wi, mirror)) return false;
  if (to_eye) {
    out.weight *= shadowing(p, out.wi);
    if (out.delta && p.flips && agrees(p, out.wi, false) && agrees(p, out.wi, true)) out.prob_reverse *= 0.5f;
    return true;
  }
  if (out.delta) {
    if (mirrors(p, out.wi) != mirror) return false;  // the viewer there sees the other frame
    out.weight *= shadowing(p, wo) * (both ? 2.0f : 1.0f) *
                  adjoint(wo, to_turned(p, wo, mirror), out.wi, to_turned(p, out.wi, mirror));
    if (both) out.prob *= 0.5f;
    return true;
  }
  const Spectrum value = eval_pdf(p, wo, out.wi, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

Spectrum passthrough(const PerturbedClosure& p, Vec3 wo) {
  const bool mirror = mirrors(p, wo);
  return agrees(p, wo, mirror) ? p.nested->passthrough(to_turned(p, wo, mirror)) : Spectrum();
}

void delta_choices(const PerturbedClosure& p, Vec3 wo, TransportMode mode, LobeRange range,
                   LobeChoices& out) {
  const auto within_frame = [&](bool mirror, LobeRange part) {
    if (agrees(p, wo, mirror)) delta_choices(*p.nested, to_turned(p, wo, mirror), mode, part, out);
  };
  if (mode == TransportMode::radiance) return within_frame(mirrors(p, wo), range);
  if (!p.flips || !agrees(p, wo, false) || !agrees(p, wo, true))
    return within_frame(p.flips && agrees(p, wo, true), range);
  within_frame(true, range.part(0, 0.5));
  within_frame(false, range.part(0.5, 1));
}

Result<void> PerturbedSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(const auto children, nested_bsdfs(object, 1, 1));
  CANDELA_ASSIGN(nested, Bsdf::build_part(*children[0], context));
  if (nested->facts().perturbs)
    return located("bump and normal maps inside of one another are not supported", *children[0], "");
  bump = object.plugin == "bumpmap";
  flips = object.get_bool("flip_invalid_normals", true);
  shadows = object.get_bool("use_shadowing_function", true);
  if (!bump) {
    if (!given(object, "normalmap"))
      return located("a normalmap needs a texture of normals", object, "normalmap");
    CANDELA_ASSIGN(normals, context.textures.color(object, "normalmap", Spectrum(0.5f, 0.5f, 1)));
    return {};
  }
  const description::Child* map = nullptr;
  for (const description::Child& child : object.children) {
    if (child.object->category != "texture") continue;
    if (map != nullptr) return located("bumpmap holds one texture, not two", *child.object, child.slot);
    map = &child;
  }
  if (map == nullptr) return located("bumpmap holds a texture, the displacement", object, "");
  CANDELA_ASSIGN(displacement, context.textures.nested_number(map->object));
  scale = static_cast<float>(object.get_number("scale", 1));
  if (!std::isfinite(scale)) return located("the scale is too large", object, "scale");
  return {};
}

void PerturbedSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  Closure& inner = arena.make();
  nested->prepare(hit, wo, arena, inner);  // seen from the same side in both frames
  Vec3d n;
  if (bump) {
    const Vec2 gradient = displacement.gradient(hit);
    const auto k = static_cast<double>(scale);
    n = displaced_normal(hit, k * static_cast<double>(gradient.x), k * static_cast<double>(gradient.y));
  } else {
    const Spectrum c = normals.eval(hit);
    n = {2 * static_cast<double>(c.r) - 1, 2 * static_cast<double>(c.g) - 1,
         2 * static_cast<double>(c.b) - 1};
  }
  PerturbedClosure p;
  p.nested = &inner;
  p.frame = frame_around(n);
  p.flips = flips;
  const Vec3 unit = p.frame.n;
  const float across2 = unit.x * unit.x + unit.y * unit.y;
  // [Estevez et al. 2019, Listing 15-1]: alpha^2 = tan^2 / 8, at most 1
  p.shadow_alpha2 = !shadows || across2 == 0
                        ? 0.0f
                        : (across2 < 8 * unit.z * unit.z ? across2 / (8 * unit.z * unit.z) : 1.0f);
  out.set(p);
  out.black = inner.black;
}

BsdfFacts PerturbedSurface::facts() const {
  BsdfFacts facts = nested->facts();
  facts.perturbs = true;
  facts.reads_partials |= bump;
  return facts;
}

std::uint32_t PerturbedSurface::arena_parts() const {
  return 1 + nested->arena_parts();
}

}  // namespace candela::scene
