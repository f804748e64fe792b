#include "worker/scene/emitters/projector.h"

#include <cmath>

#include "worker/core/math.h"
#include "worker/scene/emitters/place.h"
#include "worker/scene/sensors/field_of_view.h"
#include "worker/scene/textures/bitmap.h"
#include "worker/scene/transform.h"

namespace candela::scene {

ProjectorLight::ProjectorLight(Vec3 position, const Frame& frame, const ColorTexture& picture,
                               Quantity quantity, double scale, double tan_x, double tan_y)
    : position_(position),
      frame_(frame),
      picture_(picture),
      quantity_(quantity),
      factor_(quantity == Quantity::intensity ? static_cast<float>(scale)
                                              : math::kPi * static_cast<float>(scale)),
      tan_x_(static_cast<float>(tan_x)),
      tan_y_(static_cast<float>(tan_y)),
      cos_corner_(static_cast<float>(1 / std::sqrt(1 + tan_x * tan_x + tan_y * tan_y))),
      strength_(luminance(peak())) {
  constexpr int kSteps = 64;
  const bool is_even = picture_.is_constant() && quantity_ == Quantity::irradiance;
  const float area = 4 * tan_x_ * tan_y_;
  power_ = is_even ? picture_.constant * (factor_ * area) : power_by(kSteps);
}

Spectrum ProjectorLight::power_by(int steps) const {
  double sum[3] = {};
  for (int i = 0; i < steps * steps; ++i) {
    const Vec2 uv{(static_cast<float>(i % steps) + 0.5f) / static_cast<float>(steps),
                  (static_cast<float>(i / steps) + 0.5f) / static_cast<float>(steps)};
    Spectrum s = picture_.eval(uv);
    if (quantity_ == Quantity::intensity) {
      const float x = (1 - 2 * uv.x) * tan_x_, y = (1 - 2 * uv.y) * tan_y_;
      const float d2 = 1 + x * x + y * y;
      s = s * (1 / (d2 * std::sqrt(d2)));
    }
    sum[0] += static_cast<double>(s.r);
    sum[1] += static_cast<double>(s.g);
    sum[2] += static_cast<double>(s.b);
  }
  const float area = 4 * tan_x_ * tan_y_;
  const double each = static_cast<double>(factor_) * static_cast<double>(area) / (steps * steps);
  return {static_cast<float>(sum[0] * each), static_cast<float>(sum[1] * each),
          static_cast<float>(sum[2] * each)};
}

Spectrum ProjectorLight::peak() const {
  const float cosine = quantity_ == Quantity::intensity ? 1 : cos_corner_;
  return picture_.maximum() * (factor_ / (cosine * cosine * cosine));
}

bool ProjectorLight::picture_place(Vec3 d, Vec2& uv, float& cosine) const {
  const Vec3 local = frame_.to_local(d);
  if (!(local.z > 0)) return false;
  const float x = local.x / local.z, y = local.y / local.z;
  if (!(std::abs(x) <= tan_x_ && std::abs(y) <= tan_y_)) return false;
  uv = {0.5f - 0.5f * x / tan_x_, 0.5f - 0.5f * y / tan_y_};
  cosine = local.z;
  return true;
}

Spectrum ProjectorLight::intensity(Vec3 d) const {
  Vec2 uv;
  float cosine = 0;
  if (!picture_place(d, uv, cosine)) return {};
  if (quantity_ == Quantity::intensity) return picture_.eval(uv) * factor_;
  return picture_.eval(uv) * (factor_ / (cosine * cosine * cosine));
}

float ProjectorLight::pdf_solid_angle(Vec3 d) const {
  Vec2 uv;
  float cosine = 0;
  return picture_place(d, uv, cosine) ? 1 / (4 * tan_x_ * tan_y_ * cosine * cosine * cosine) : 0.0f;
}

DirectOutcome ProjectorLight::sample_direct(const SurfaceHit& reference, Vec3 front, double /*rest*/,
                                            Vec2 /*u*/, DirectSample& out) const {
  return sample_place(
      position_, reference, front, [this](Vec3 d) { return intensity(d); }, out);
}

bool ProjectorLight::sample_emission(const SceneExtent& /*scene*/, double /*rest*/, Vec2 /*u_position*/,
                                     Vec2 u_direction, EmissionSample& out) const {
  // Rounding must not put a direction beside the picture.
  constexpr float kInside = 1 - 0x1p-20f;
  const Vec3 local = {(1 - 2 * u_direction.x) * tan_x_ * kInside, (1 - 2 * u_direction.y) * tan_y_ * kInside,
                      1};
  const Vec3 d = normalize(frame_.to_world(local));
  out.delta_position = true;
  out.pdf_area = 1;
  out.radiance = intensity(d);
  out.pdf_solid_angle = pdf_solid_angle(d);
  if (!(out.pdf_solid_angle > 0)) return false;
  start_at(position_, d, out);
  return true;
}

bool ProjectorLight::pdf_emission(const SceneExtent& /*scene*/, Vec3 /*ng*/, Vec3 d,
                                  EmissionDensity& out) const {
  return pdf_emission_place(pdf_solid_angle(d), out);
}

LightBounds ProjectorLight::bounds(const Geometry& /*geometry*/) const {
  LightBounds out;
  out.box.add(Vec3d(position_));
  out.axis = frame_.n;
  out.spread = math::atan2f(std::sqrt(tan_x_ * tan_x_ + tan_y_ * tan_y_), 1);
  out.strength = strength_;
  return out;
}

Result<ProjectorLight> ProjectorLight::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(const ColorTexture picture, textures.color(object, "irradiance", Spectrum(1.0f)));
  if (picture.is_constant() && !is_radiometric(picture.constant))
    return emitter_error(object, "irradiance must be finite and not negative", "irradiance");
  const double aspect = aspect_of(picture.texture), scale = object.get_number("scale", 1);
  CANDELA_ASSIGN(const double half_width, half_width_at_unit_depth(object, aspect));
  const Transform to_world(object.get_transform("to_world"));
  CANDELA_ASSIGN(const Frame frame, read_frame(object, to_world));
  const Quantity quantity =
      object.get_string("quantity", "irradiance") == "intensity" ? Quantity::intensity : Quantity::irradiance;
  const auto light = [&](double factor) {
    return ProjectorLight(Vec3(to_world.translation()), frame, picture, quantity, factor, half_width,
                          half_width / aspect);
  };
  if (object.find("power") == nullptr) return light(scale);
  constexpr int kSteps = 1024;  // many pictures have no more pixels
  const double factor =
      object.get_number("power", 0) / static_cast<double>(luminance(light(1).power_by(kSteps)));
  if (!std::isfinite(static_cast<float>(factor)))
    return emitter_error(object, "a black light cannot be scaled to a power", "power");
  return light(factor);
}

}  // namespace candela::scene
