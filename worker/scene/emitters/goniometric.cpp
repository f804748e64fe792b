#include "worker/scene/emitters/goniometric.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "worker/core/math.h"
#include "worker/scene/emitters/cone.h"
#include "worker/scene/emitters/distribution.h"
#include "worker/scene/emitters/equal_area.h"
#include "worker/scene/emitters/place.h"
#include "worker/scene/transform.h"

namespace candela::scene {

struct DirectionPicture::Tables {
  std::uint32_t side = 0;
  std::vector<float> values;  // row by row
  Distribution rows;
  std::vector<Distribution> columns;  // of each row

  float at(Vec3 local) const {
    const Vec2 uv = equal_area_square(Vec3d(local));
    const auto pixel = [&](float x) {
      return std::min(static_cast<std::uint32_t>(std::max(x, 0.0f) * static_cast<float>(side)), side - 1);
    };
    return values[static_cast<std::size_t>(pixel(uv.y)) * side + pixel(uv.x)];
  }
};

DirectionPicture::DirectionPicture(const TexelImage& image) {
  auto tables = std::make_unique<Tables>();
  tables->side = image.width;
  tables->values.reserve(static_cast<std::size_t>(image.width) * image.width);
  std::vector<double> rows, row;
  for (std::uint32_t y = 0; y < image.width; ++y) {
    row.clear();
    double sum = 0;
    for (std::uint32_t x = 0; x < image.width; ++x) {
      const Spectrum s = image.at(x, y);
      const float value = s.r / 3 + s.g / 3 + s.b / 3;
      tables->values.push_back(value);
      maximum_ = std::max(maximum_, value);
      row.push_back(static_cast<double>(value));
      sum += row.back();
    }
    rows.push_back(sum);
    tables->columns.emplace_back(row);
  }
  tables->rows = Distribution(rows);
  mean_ = tables->rows.total() / static_cast<double>(tables->values.size());
  tables_ = std::move(tables);
}

DirectionPicture::~DirectionPicture() = default;

float DirectionPicture::value(Vec3 local) const {
  return tables_->at(local);
}

Vec3 DirectionPicture::sample(Vec2 u) const {
  double in_row = 0, in_column = 0;
  const std::uint32_t y = tables_->rows.sample(static_cast<double>(u.y), &in_row);
  const std::uint32_t x = tables_->columns[y].sample(static_cast<double>(u.x), &in_column);
  return Vec3(equal_area_direction((x + in_column) / tables_->side, (y + in_row) / tables_->side));
}

float DirectionPicture::pdf_solid_angle(Vec3 local) const {
  return static_cast<float>(static_cast<double>(value(local)) / (4 * std::numbers::pi * mean_));
}

GoniometricLight::GoniometricLight(Vec3 position, const Frame& frame, Spectrum intensity,
                                   std::shared_ptr<const DirectionPicture> picture)
    : position_(position),
      frame_(frame),
      intensity_(intensity),
      strength_(luminance(intensity)),
      picture_(std::move(picture)) {}

DirectOutcome GoniometricLight::sample_direct(const SurfaceHit& reference, Vec3 front, double /*rest*/,
                                              Vec2 /*u*/, DirectSample& out) const {
  return sample_place(
      position_, reference, front, [this](Vec3 d) { return intensity(d); }, out);
}

bool GoniometricLight::sample_emission(const SceneExtent& /*scene*/, double /*rest*/, Vec2 /*u_position*/,
                                       Vec2 u_direction, EmissionSample& out) const {
  const Vec3 d = normalize(frame_.to_world(picture_->sample(u_direction)));
  out.delta_position = true;
  out.pdf_area = 1;
  out.radiance = intensity(d);
  out.pdf_solid_angle = picture_->pdf_solid_angle(frame_.to_local(d));
  if (!(out.pdf_solid_angle > 0)) return false;  // on the edge of a pixel, by rounding
  start_at(position_, d, out);
  return true;
}

bool GoniometricLight::pdf_emission(const SceneExtent& /*scene*/, Vec3 /*ng*/, Vec3 d,
                                    EmissionDensity& out) const {
  return pdf_emission_place(picture_->pdf_solid_angle(frame_.to_local(d)), out);
}

Spectrum GoniometricLight::power(const SceneExtent& /*scene*/) const {
  return intensity_ * static_cast<float>(4 * std::numbers::pi * picture_->mean());
}

LightBounds GoniometricLight::bounds(const Geometry& /*geometry*/) const {
  LightBounds out;
  out.box.add(Vec3d(position_));
  out.spread = math::kPi;
  out.strength = luminance(peak());
  return out;
}

float GoniometricLight::importance(Vec3 p, Vec3 front) const {
  const Vec3 v = position_ - p;
  const float d2 = std::max(length_squared(v), 1e-36f);
  const float h = is_zero(front) ? std::sqrt(d2) : dot(front, v);
  if (!(h > 0)) return 0;
  const float strength = strength_ * picture_->value(frame_.to_local(v * (-1 / std::sqrt(d2))));
  const float cosine = is_zero(front) ? 1 : std::max(h / std::sqrt(d2), kMinBoundCosine);
  return std::min(strength * cosine / d2, kMaxImportance);
}

Result<GoniometricLight> GoniometricLight::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(Spectrum intensity, read_quantity(object, "intensity"));
  const description::Property* named = object.find("filename");
  const description::Location where = named != nullptr ? named->where : object.where;
  CANDELA_ASSIGN(const auto image, textures.image(object.get_string("filename", ""), {}, where));
  if (image->width != image->height || image->width > DirectionPicture::kMaxSide)
    return emitter_error(object,
                         "the picture of a goniometric light is square, of at most " +
                             std::to_string(DirectionPicture::kMaxSide) + " pixels a side",
                         "filename");
  if (!is_radiometric(image->minimum) || !is_radiometric(image->maximum))
    return emitter_error(object, "the picture of a goniometric light must be finite and not negative",
                         "filename");
  auto picture = std::make_shared<const DirectionPicture>(*image);
  if (object.find("power") != nullptr) {
    const double power = static_cast<double>(luminance(intensity)) * 4 * std::numbers::pi * picture->mean();
    const auto factor = static_cast<float>(object.get_number("power", 0) / power);
    if (!std::isfinite(factor))
      return emitter_error(object, "a black light cannot be scaled to a power", "power");
    intensity = intensity * factor;
  }
  const Transform to_world(object.get_transform("to_world"));
  CANDELA_ASSIGN(const Frame frame, read_frame(object, to_world));
  // +y of the light is the picture's +z.
  const Frame turned{frame.s, frame.n, frame.t};
  return GoniometricLight(Vec3(to_world.translation()), turned, intensity, std::move(picture));
}

}  // namespace candela::scene
