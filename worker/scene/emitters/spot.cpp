#include "worker/scene/emitters/spot.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/emitters/double_math.h"
#include "worker/scene/emitters/place.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

constexpr double kPi = std::numbers::pi;

}  // namespace

SpotLight::SpotLight(Vec3 position, const Frame& frame, Spectrum intensity, double cutoff, double beam,
                     const ColorTexture& texture)
    : position_(position),
      frame_(frame),
      intensity_(intensity),
      texture_(texture),
      strength_(luminance(peak())) {
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

DirectOutcome SpotLight::sample_direct(const SurfaceHit& reference, Vec3 front, double /*rest*/, Vec2 /*u*/,
                                       DirectSample& out) const {
  return sample_place(
      position_, reference, front, [this](Vec3 d) { return intensity(d); }, out);
}

bool SpotLight::sample_emission(const SceneExtent& /*scene*/, double /*rest*/, Vec2 /*u_position*/,
                                Vec2 u_direction, EmissionSample& out) const {
  const Vec3 d = sample(u_direction);
  out.delta_position = true;
  out.pdf_area = 1;
  out.radiance = intensity(d);
  out.pdf_solid_angle = pdf_solid_angle(d);
  if (!(out.pdf_solid_angle > 0)) return false;  // on the rim, by rounding
  start_at(position_, d, out);
  return true;
}

bool SpotLight::pdf_emission(const SceneExtent& /*scene*/, Vec3 /*ng*/, Vec3 d, EmissionDensity& out) const {
  return pdf_emission_place(pdf_solid_angle(d), out);
}

LightBounds SpotLight::bounds(const Geometry& /*geometry*/) const {
  LightBounds out;
  out.box.add(Vec3d(position_));
  out.axis = frame_.n;
  out.spread = beam_;
  out.emission = cutoff_ - beam_;
  out.strength = strength_;
  return out;
}

Result<SpotLight> SpotLight::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(const Spectrum intensity, read_quantity(object, "intensity"));
  CANDELA_ASSIGN(const ColorTexture texture, textures.color(object, "texture", Spectrum(1.0f)));
  const double cutoff = object.get_number("cutoff_angle", 20);
  const double beam = object.get_number("beam_width", cutoff * 3 / 4);
  if (!(cutoff > 0 && cutoff <= 180))
    return emitter_error(object, "cutoff_angle is above 0 and at most 180 degrees", "cutoff_angle");
  if (!(beam >= 0 && beam <= cutoff))
    return emitter_error(object, "beam_width is not within 0 and cutoff_angle", "beam_width");
  if (!texture.is_constant() && cutoff > 89.9)
    return emitter_error(object,
                         "a texture cannot be projected into a cone of cutoff_angle 90 degrees or more",
                         "cutoff_angle");
  const Transform to_world(object.get_transform("to_world"));
  CANDELA_ASSIGN(const Frame frame, read_frame(object, to_world));
  constexpr double kRadians = std::numbers::pi / 180;
  return SpotLight(Vec3(to_world.translation()), frame, intensity, cutoff * kRadians, beam * kRadians,
                   texture);
}

}  // namespace candela::scene
