#include "worker/scene/emitters/spot.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "worker/core/math.h"
#include "worker/core/warp.h"

namespace candela::scene {
namespace {

constexpr double kPi = std::numbers::pi;

void sincos_double(double x, double& sine, double& cosine) {  // x in [0, pi]
  std::uint64_t quadrant = 0;
  const double r = math::detail::reduce_quadrant(x, quadrant);
  const double s = math::detail::sin_kernel(r), c = math::detail::cos_kernel(r);
  sine = (quadrant & 1) != 0 ? c : s;
  cosine = (quadrant & 1) != 0 ? -s : c;
  if ((quadrant & 2) != 0) {
    sine = -sine;
    cosine = -cosine;
  }
}

}  // namespace

SpotLight::SpotLight(Vec3 position, const Frame& frame, Spectrum intensity, double cutoff, double beam,
                     const ColorTexture& texture)
    : position_(position), frame_(frame), intensity_(intensity), texture_(texture) {
  double sin_cutoff = 0, cos_cutoff = 0, sin_beam = 0, cos_beam = 0, half_sine = 0, half_cosine = 0;
  sincos_double(cutoff, sin_cutoff, cos_cutoff);
  sincos_double(beam, sin_beam, cos_beam);
  sincos_double(cutoff / 2, half_sine, half_cosine);
  cutoff_ = static_cast<float>(cutoff);
  beam_ = static_cast<float>(beam);
  cos_cutoff_ = static_cast<float>(cos_cutoff);
  one_minus_cos_ = static_cast<float>(2 * half_sine * half_sine);
  inverse_transition_ = cutoff > beam ? static_cast<float>(1 / (cutoff - beam)) : 0.0f;
  inverse_tangent_ = static_cast<float>(cos_cutoff / sin_cutoff);
  if (texture_.is_constant()) {
    // The integral of the falloff over the cone: 2 pi (1 - (sin c - sin b) / (c - b)).
    const double mean = cutoff - beam > 1e-6 ? (sin_cutoff - sin_beam) / (cutoff - beam) : cos_cutoff;
    const double solid_angle =
        cutoff < 1e-2 ? kPi / 3 * (cutoff * cutoff + cutoff * beam + beam * beam) : 2 * kPi * (1 - mean);
    power_ = intensity_ * texture_.constant * static_cast<float>(solid_angle);
  } else {
    constexpr int kSteps = 64;
    double sum[3] = {};
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const Vec2 u{(static_cast<float>(i % kSteps) + 0.5f) / kSteps,
                   (static_cast<float>(i / kSteps) + 0.5f) / kSteps};
      const Spectrum s = this->intensity(sample(u));
      sum[0] += static_cast<double>(s.r);
      sum[1] += static_cast<double>(s.g);
      sum[2] += static_cast<double>(s.b);
    }
    const double each = 2 * kPi * static_cast<double>(one_minus_cos_) / (kSteps * kSteps);
    power_ = {static_cast<float>(sum[0] * each), static_cast<float>(sum[1] * each),
              static_cast<float>(sum[2] * each)};
  }
}

float SpotLight::falloff(Vec3 local) const {
  // The angle by its sine and cosine: acos is imprecise in a narrow beam.
  const float angle = math::atan2f(std::sqrt(local.x * local.x + local.y * local.y), local.z);
  if (angle >= cutoff_ && cutoff_ < math::kPi) return 0;
  if (angle <= beam_) return 1;
  return std::max(0.0f, (cutoff_ - angle) * inverse_transition_);
}

Spectrum SpotLight::intensity(Vec3 d) const {
  const Vec3 local = frame_.to_local(d);
  const float f = falloff(local);
  if (!(f > 0)) return {};
  if (texture_.is_constant()) return intensity_ * texture_.constant * f;
  const float scale = 0.5f * inverse_tangent_ / local.z;  // local.z > 0: the cutoff is below a right angle
  return intensity_ * texture_.eval({0.5f + local.x * scale, 0.5f + local.y * scale}) * f;
}

Vec3 SpotLight::sample(Vec2 u) const {
  return normalize(frame_.to_world(warp::uniform_cone(u, one_minus_cos_)));
}

float SpotLight::pdf_solid_angle(Vec3 d) const {
  return falloff(frame_.to_local(d)) > 0 ? warp::pdf_uniform_cone_solid_angle(one_minus_cos_) : 0.0f;
}

}  // namespace candela::scene
