#include "worker/scene/textures/primaries.h"

#include <cmath>

namespace candela::scene {
namespace {

constexpr std::array<float, 8> kRec709 = {0.64F, 0.33F, 0.3F, 0.6F, 0.15F, 0.06F, 0.3127F, 0.329F};

using Matrix = std::array<Vec3d, 3>;  // rows

Vec3d times(const Matrix& m, Vec3d v) {
  return {dot(m[0], v), dot(m[1], v), dot(m[2], v)};
}

Matrix columns(Vec3d a, Vec3d b, Vec3d c) {
  return {Vec3d{a.x, b.x, c.x}, Vec3d{a.y, b.y, c.y}, Vec3d{a.z, b.z, c.z}};
}

std::optional<Matrix> inverse(const Matrix& m) {
  const Vec3d a = cross(m[1], m[2]), b = cross(m[2], m[0]), c = cross(m[0], m[1]);
  const double determinant = dot(m[0], a);
  if (!(std::abs(determinant) > 1e-12)) return std::nullopt;
  return columns(a / determinant, b / determinant, c / determinant);
}

// To CIE XYZ; white has Y = 1.
std::optional<Matrix> to_xyz(const std::array<float, 8>& c) {
  const auto point = [&](std::size_t i) {
    const auto x = static_cast<double>(c[2 * i]), y = static_cast<double>(c[2 * i + 1]);
    return Vec3d{x, y, 1 - x - y};
  };
  const Matrix primaries = columns(point(0), point(1), point(2));
  const Vec3d white = point(3);
  const std::optional<Matrix> back = inverse(primaries);
  if (!back || !(white.y > 0)) return std::nullopt;
  const Vec3d scale = times(*back, white / white.y);
  return columns(point(0) * scale.x, point(1) * scale.y, point(2) * scale.z);
}

}  // namespace

std::optional<std::array<Vec3d, 3>> to_rec709(const std::array<float, 8>& chromaticities) {
  double difference = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    const auto d = static_cast<double>(chromaticities[i] - kRec709[i]);
    difference += d * d;
  }
  if (!(difference >= 1e-6)) return std::nullopt;  // as Mitsuba compares
  const std::optional<Matrix> from = to_xyz(chromaticities);
  const std::optional<Matrix> xyz_to_rec709 = inverse(*to_xyz(kRec709));
  if (!from) return std::nullopt;
  Matrix product;
  for (std::size_t row = 0; row < 3; ++row) {
    const Vec3d& r = (*xyz_to_rec709)[row];
    product[row] = (*from)[0] * r.x + (*from)[1] * r.y + (*from)[2] * r.z;
    if (!std::isfinite(product[row].x + product[row].y + product[row].z)) return std::nullopt;
  }
  return product;
}

}  // namespace candela::scene
