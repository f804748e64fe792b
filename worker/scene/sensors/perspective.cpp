#include "worker/scene/sensors/perspective.h"

#include <charconv>
#include <cmath>
#include <numbers>

#include "worker/core/math.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

Error error_at(const description::Object& object, std::string_view field, std::string message) {
  return input_error(std::move(message))
      .at(object.where.file, object.where.line)
      .with_field(std::string(field));
}

constexpr double kPi = std::numbers::pi;

// Tangent of an angle in (0, pi/2), in double from the series that float results are made of (1e-10).
double tangent(double x) {
  std::uint64_t quadrant = 0;
  const double r = math::detail::reduce_quadrant(x, quadrant);
  const double s = math::detail::sin_kernel(r), c = math::detail::cos_kernel(r);
  return (quadrant & 1) != 0 ? -c / s : s / c;
}
double arc_tangent(double t) {
  return t > 1 ? kPi / 2 - math::detail::atan_unit(1 / t) : math::detail::atan_unit(t);
}

// "50mm" or "50": 35 mm film equivalent.
Result<double> focal_length_mm(const description::Object& sensor) {
  const description::Property* property = sensor.find("focal_length");
  double value = 50;
  if (property != nullptr && property->type != description::PropertyType::string) {
    value = sensor.get_number("focal_length", 50);
  } else if (property != nullptr) {
    std::string text = sensor.get_string("focal_length", "50mm");
    if (text.ends_with("mm")) text.resize(text.size() - 2);
    while (!text.empty() && text.back() == ' ') text.pop_back();
    const auto [rest, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (code != std::errc() || rest != text.data() + text.size()) {
      return error_at(
          sensor, "focal_length",
          "focal_length '" + sensor.get_string("focal_length", "") + "' is not a length such as 50mm");
    }
  }
  if (!(value > 0) || !std::isfinite(value))
    return error_at(sensor, "focal_length", "focal_length must be above 0");
  return value;
}

// Half the film's width at unit depth.
Result<double> half_width(const description::Object& sensor, double aspect) {
  const bool has_fov = sensor.find("fov") != nullptr;
  if (has_fov && sensor.find("focal_length") != nullptr) {
    return error_at(sensor, "fov", "give either fov or focal_length, not both");
  }
  double tan_half = 0;
  std::string axis = sensor.get_string("fov_axis", "x");
  if (has_fov) {
    const double fov = sensor.get_number("fov", 0);
    if (!(fov > 0 && fov < 180)) {
      return error_at(sensor, "fov", "fov must be between 0 and 180 degrees, not " + std::to_string(fov));
    }
    tan_half = tangent(fov * kPi / 360);
  } else {
    // The diagonal of a 36 mm by 24 mm frame.
    CANDELA_ASSIGN(const double focal_length, focal_length_mm(sensor));
    tan_half = std::sqrt(36.0 * 36.0 + 24.0 * 24.0) / (2 * focal_length);
    axis = "diagonal";
  }
  if (axis == "smaller") axis = aspect > 1 ? "y" : "x";
  if (axis == "larger") axis = aspect > 1 ? "x" : "y";
  if (axis == "x") return tan_half;
  if (axis == "y") return tan_half * aspect;
  if (axis == "diagonal") return tan_half / std::sqrt(1 + 1 / (aspect * aspect));
  return error_at(sensor, "fov_axis", "fov_axis '" + axis + "' is none of x, y, diagonal, smaller, larger");
}

}  // namespace

Result<PerspectiveSensor> PerspectiveSensor::build(const description::Object& sensor,
                                                   std::uint32_t film_width, std::uint32_t film_height) {
  if (sensor.plugin != "perspective") {
    return input_error("sensor '" + sensor.plugin + "' is not supported yet (perspective is)")
        .at(sensor.where.file, sensor.where.line);
  }
  if (film_width == 0 || film_height == 0) return usage_error("the film has no pixels").with_field("size");
  const double width = film_width, height = film_height, aspect = width / height;
  CANDELA_ASSIGN(const double half, half_width(sensor, aspect));

  PerspectiveSensor out;
  out.near_clip_ = sensor.get_number("near_clip", 1e-2);
  out.far_clip_ = sensor.get_number("far_clip", 1e4);
  if (!(out.near_clip_ > 0)) return error_at(sensor, "near_clip", "near_clip must be above 0");
  if (!(out.far_clip_ > out.near_clip_))
    return error_at(sensor, "far_clip", "far_clip must be beyond near_clip");
  out.horizontal_fov_degrees_ = 360 / kPi * arc_tangent(half);

  const Transform to_world(sensor.get_transform("to_world"));
  // Mitsuba refuses scale too: distances of the clip planes would have no meaning. Mirrors are fine.
  for (int i = 0; i < 3; ++i) {
    if (std::abs(length(to_world.column(i)) - 1) > 1e-3) {
      return error_at(sensor, "to_world", "a camera's to_world must not scale")
          .with_mend("use lookat, or rotations and a translation alone");
    }
  }
  // Film position f in [0, 1]^2 is the direction ((1 - 2 f_x) half, (1 - 2 f_y) half / aspect, 1); the
  // principal point's offset moves f.
  const double offset_x = sensor.get_number("principal_point_offset_x", 0);
  const double offset_y = sensor.get_number("principal_point_offset_y", 0);
  const Vec3d x = normalize(to_world.column(0)), y = normalize(to_world.column(1)),
              z = normalize(to_world.column(2));
  out.origin_ = to_world.translation();
  out.axis_ = z + x * (half * (1 - 2 * offset_x)) + y * (half / aspect * (1 - 2 * offset_y));
  out.across_ = x * (-2 * half / width);
  out.down_ = y * (-2 * half / aspect / height);
  return out;
}

}  // namespace candela::scene
