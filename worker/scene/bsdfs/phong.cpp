#include "worker/scene/bsdfs/phong.h"

#include <algorithm>
#include <cmath>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

constexpr float kMaxExponent = 1e6f;  // beyond, the lobe is narrower than float directions resolve

float clamped_exponent(float exponent) {
  return std::clamp(exponent, 0.0f, kMaxExponent);
}

// The Beckmann roughness of a lobe as wide.
float roughness_of(float exponent) {
  return std::sqrt(2 / (exponent + 2));
}

// cos^n of the angle between unit vectors. From their difference: for large n the cosine as a float has too
// few digits.
float cosine_power(Vec3 a, Vec3 b, float exponent) {
  const Vec3d difference = Vec3d(a) - Vec3d(b);
  const double cosine = 1 - 0.5 * length_squared(difference);
  if (!(cosine > 0)) return 0;
  return static_cast<float>(math::exp(static_cast<double>(exponent) * math::log(cosine)));
}

}  // namespace

Spectrum eval_pdf(const PhongClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  const float power = cosine_power(wi, {-wo.x, -wo.y, wo.z}, p.exponent) * (0.5f * math::kInvPi);
  const float cosine = wi.z * math::kInvPi;
  pdf = p.prob_specular * (p.exponent + 1) * power + (1 - p.prob_specular) * cosine;
  return p.diffuse * cosine + p.specular * ((p.exponent + 2) * power * wi.z);
}

Spectrum eval_diffuse(const PhongClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  PhongClosure diffuse = p;
  if (roughness_of(p.exponent) < glossy_below) diffuse.specular = {};
  float pdf = 0;
  return eval_pdf(diffuse, wo, wi, mode, pdf);
}

bool sample(const PhongClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  if (wo.z <= 0) return false;
  if (u_lobe < p.prob_specular) {
    const double log_cosine = math::log(1 - static_cast<double>(u.y)) / (static_cast<double>(p.exponent) + 1);
    const auto z = static_cast<float>(math::exp(log_cosine));
    const auto r = static_cast<float>(std::sqrt(std::max(0.0, 1 - math::exp(2 * log_cosine))));
    float s = 0;
    float c = 0;
    math::sincosf(2 * math::kPi * u.x, s, c);
    out.wi = normalize(make_frame({-wo.x, -wo.y, wo.z}).to_world({r * c, r * s, z}));
    if (!(out.wi.z > 0)) return false;  // into the surface
  } else {
    out.wi = warp::cosine_hemisphere(u);
  }
  const Spectrum value = eval_pdf(p, wo, out.wi, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

Result<void> PhongSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_TRY(colors.build(object, context));
  CANDELA_ASSIGN(exponent, context.textures.number(object, "exponent", 30));
  if (exponent.minimum() < 0) return located("the exponent is not negative", object, "exponent");
  return {};
}

void PhongSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  PhongClosure p = {};
  if (!below) {
    p.prob_specular = colors.prepare(at, p.diffuse, p.specular);
    p.exponent = clamped_exponent(exponent.eval(at));
  }
  out.set(p);
  out.black = p.diffuse.is_black() && p.specular.is_black();
}

BsdfFacts PhongSurface::facts() const {
  const float most = exponent.texture == nullptr ? exponent.constant : luminance(exponent.texture->maximum());
  return {.smooth = true,
          .max_albedo = colors.max_albedo(),
          .min_roughness = std::min(1.0f, roughness_of(clamped_exponent(most)))};
}

}  // namespace candela::scene
