#include "worker/scene/bsdfs/ward.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "worker/core/warp.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {
namespace {

// cos theta_i times the lobe, but for D.
float shape(const WardClosure& p, Vec3 wo, Vec3 wi, float h_z, float cos_d) {
  const float z4 = h_z * h_z * h_z * h_z;
  // The first two are infinite at grazing views.
  const float cos_o = std::max(wo.z, 1e-6f);
  switch (p.variant) {
    case WardVariant::ward:
      return 0.25f * z4 * std::sqrt(wi.z / cos_o);
    case WardVariant::ward_duer:
      return 0.25f * z4 / cos_o;
    case WardVariant::balanced:
      break;
  }
  return 0.25f * wi.z / (cos_d * cos_d);
}

}  // namespace

Spectrum eval_pdf(const WardClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  const float cosine = wi.z * math::kInvPi;
  pdf = (1 - p.prob_specular) * cosine;
  Spectrum value = p.diffuse * cosine;
  const Vec3 sum = wo + wi;
  const float len2 = length_squared(sum);
  if (!(len2 > 0)) return value;
  const Vec3 h = sum * (1 / std::sqrt(len2));
  const float cos_d = std::max(dot(wo, h), 1e-6f);
  const float d = Microfacets{p.alpha_u, p.alpha_v, false}.D(h);
  pdf += p.prob_specular * 0.25f * d * h.z / cos_d;
  value += p.specular * (d * shape(p, wo, wi, h.z, cos_d));
  return value;
}

Spectrum eval_diffuse(const WardClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  WardClosure diffuse = p;
  if (std::max(p.alpha_u, p.alpha_v) < glossy_below) diffuse.specular = {};
  float pdf = 0;
  return eval_pdf(diffuse, wo, wi, mode, pdf);
}

bool sample(const WardClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  if (wo.z <= 0) return false;
  if (u_lobe < p.prob_specular) {
    const Vec3 h = Microfacets{p.alpha_u, p.alpha_v, false}.sample_all(u);
    const float cos_d = dot(wo, h);
    if (!(cos_d > 0)) return false;
    const Vec3 reflected = h * (2 * cos_d) - wo;
    if (!(reflected.z > 0)) return false;  // into the surface
    out.wi = normalize(reflected);
  } else {
    out.wi = warp::cosine_hemisphere(u);
  }
  const Spectrum value = eval_pdf(p, wo, out.wi, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

Result<void> WardSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_TRY(colors.build(object, context));
  // alpha is what the other two are by default.
  const auto alpha = static_cast<float>(object.get_number("alpha", 0.1));
  CANDELA_ASSIGN(alpha_u, context.textures.number(object, "alpha_u", alpha));
  CANDELA_ASSIGN(alpha_v, context.textures.number(object, "alpha_v", alpha));
  for (const auto& [name, value] : {std::pair{"alpha_u", &alpha_u}, std::pair{"alpha_v", &alpha_v}}) {
    if (!(value->minimum() >= 0)) return located("roughness is not negative", object, name);
  }
  const std::string name = object.get_string("variant", "balanced");
  if (name == "ward") {
    variant = WardVariant::ward;
  } else if (name == "ward-duer") {
    variant = WardVariant::ward_duer;
  } else if (name != "balanced") {
    return located("unknown variant '" + name + "'; known: ward, ward-duer, balanced", object, "variant");
  }
  return {};
}

void WardSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  WardClosure p = {};
  if (!below) {
    p.prob_specular = colors.prepare(at, p.diffuse, p.specular);
    // Above 10 nothing changes but that the density underflows.
    p.alpha_u = std::clamp(alpha_u.eval(at), kMinAlpha, 10.0f);
    p.alpha_v = std::clamp(alpha_v.eval(at), kMinAlpha, 10.0f);
    p.variant = variant;
  }
  out.set(p);
  out.black = p.diffuse.is_black() && p.specular.is_black();
}

BsdfFacts WardSurface::facts() const {
  return {.smooth = true,
          .max_albedo = colors.max_albedo(),
          .min_roughness = std::clamp(std::min(alpha_u.minimum(), alpha_v.minimum()), kMinAlpha, 1.0f)};
}

}  // namespace candela::scene
