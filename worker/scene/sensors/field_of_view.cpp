#include "worker/scene/sensors/field_of_view.h"

#include <charconv>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

constexpr double kPi = std::numbers::pi;

Error error_at(const description::Object& object, std::string_view field, std::string message) {
  return input_error(std::move(message))
      .at(object.where.file, object.where.line)
      .with_field(std::string(field));
}

// Tangent of an angle in (0, pi/2), in double from the series that float results are made of (1e-10).
double tangent(double x) {
  std::uint64_t quadrant = 0;
  const double r = math::detail::reduce_quadrant(x, quadrant);
  const double s = math::detail::sin_kernel(r), c = math::detail::cos_kernel(r);
  return (quadrant & 1) != 0 ? -c / s : s / c;
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

}  // namespace

Result<double> half_width_at_unit_depth(const description::Object& sensor, double aspect) {
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

}  // namespace candela::scene
