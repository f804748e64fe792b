#include "worker/scene/emitters/equal_area.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

// Beyond an edge of the square the sphere goes on at the same edge, mirrored.
Spectrum texel(const TexelImage& image, std::int64_t x, std::int64_t y) {
  const std::int64_t n = image.width;
  if (x < 0 || x >= n) {
    x = x < 0 ? -1 - x : 2 * n - 1 - x;
    y = n - 1 - y;
  }
  if (y < 0 || y >= n) {
    y = y < 0 ? -1 - y : 2 * n - 1 - y;
    x = n - 1 - x;
  }
  return image.at(static_cast<std::uint32_t>(std::clamp<std::int64_t>(x, 0, n - 1)),
                  static_cast<std::uint32_t>(std::clamp<std::int64_t>(y, 0, n - 1)));
}

Spectrum lookup(const TexelImage& image, Vec2 uv) {
  const double x = static_cast<double>(uv.x) * image.width - 0.5,
               y = static_cast<double>(uv.y) * image.width - 0.5;
  const double fx = std::floor(x), fy = std::floor(y);
  const auto ix = static_cast<std::int64_t>(fx), iy = static_cast<std::int64_t>(fy);
  const auto wx = static_cast<float>(x - fx), wy = static_cast<float>(y - fy);
  const Spectrum top = texel(image, ix, iy) * (1 - wx) + texel(image, ix + 1, iy) * wx;
  const Spectrum bottom = texel(image, ix, iy + 1) * (1 - wx) + texel(image, ix + 1, iy + 1) * wx;
  return top * (1 - wy) + bottom * wy;
}

}  // namespace

Vec2 equal_area_square(Vec3d d) {
  const double x = std::abs(d.x), y = std::abs(d.y), z = std::abs(d.z);
  // sqrt(1 - |z|), exact at the poles.
  const double r = std::sqrt((x * x + y * y) / (1 + z));
  const double angle = math::atan2(y, x) * (2 / std::numbers::pi);
  double v = std::min(angle, 1.0) * r, u = r - v;
  if (d.z < 0) {
    std::swap(u, v);
    u = 1 - u;
    v = 1 - v;
  }
  return {static_cast<float>((std::copysign(u, d.x) + 1) / 2),
          static_cast<float>((std::copysign(v, d.y) + 1) / 2)};
}

Vec3d equal_area_direction(double x, double y) {
  const double u = 2 * x - 1, v = 2 * y - 1;
  const double inside = 1 - (std::abs(u) + std::abs(v));  // above 0 in the half of +z
  const double r = 1 - std::abs(inside);
  const double phi = r > 0 ? ((std::abs(v) - std::abs(u)) / r + 1) * (std::numbers::pi / 4) : 0;
  double sin_phi = 0, cos_phi = 0;
  math::sincos(phi, sin_phi, cos_phi);
  const double sin_theta = r * std::sqrt(2 - r * r);
  return {std::copysign(cos_phi * sin_theta, u), std::copysign(sin_phi * sin_theta, v),
          std::copysign(1 - r * r, inside)};
}

Result<TexelImage> latitude_longitude(const TexelImage& square, Scratch& scratch) {
  TexelImage image;
  image.file = square.file;
  image.width = 2 * square.width;
  image.height = square.width + 1;
  image.format = TexelFormat::rgb32;
  CANDELA_ASSIGN(TexelWriter writer, TexelWriter::create(scratch, image));
  std::vector<float> row(std::size_t{3} * image.width);
  for (std::uint32_t r = 0; r < image.height; ++r) {
    double sin_theta = 0, cos_theta = 0;
    math::sincos(std::numbers::pi * r / (image.height - 1), sin_theta, cos_theta);
    for (std::uint32_t c = 0; c < image.width; ++c) {
      double sin_phi = 0, cos_phi = 0;
      math::sincos(2 * std::numbers::pi * (c + 0.5) / image.width, sin_phi, cos_phi);
      // As Environment: u = atan2(x, -z) / 2 pi, v = acos(y) / pi.
      const Vec3d d = {sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi};
      const Spectrum value = lookup(square, equal_area_square(d));
      row[3 * c] = value.r;
      row[3 * c + 1] = value.g;
      row[3 * c + 2] = value.b;
    }
    CANDELA_TRY(writer.add_row(row.data(), 3, {0, 1, 2}));
  }
  CANDELA_TRY(writer.finish(image));
  return image;
}

}  // namespace candela::scene
