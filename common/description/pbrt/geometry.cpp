#include "common/description/pbrt/geometry.h"

#include <cmath>

#include "common/description/transform.h"

namespace candela::description::pbrt {
namespace {

Vec3 column(const Mat4& m, std::size_t i) {
  return {m[i], m[4 + i], m[8 + i]};
}

Vec3 cross_product(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot_product(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double determinant(const Mat4& m) {
  return dot_product(cross_product(column(m, 0), column(m, 1)), column(m, 2));
}

}  // namespace

std::optional<Mat4> inverse(const Mat4& m) {
  if (!transform::is_finite(m) || !transform::is_affine(m) || !transform::is_invertible(m))
    return std::nullopt;
  const double d = determinant(m);
  const Vec3 rows[3] = {cross_product(column(m, 1), column(m, 2)), cross_product(column(m, 2), column(m, 0)),
                        cross_product(column(m, 0), column(m, 1))};
  Mat4 result = transform::identity;
  const Vec3 t = column(m, 3);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) result[4 * i + j] = rows[i][j] / d;
    result[4 * i + 3] = -dot_product(rows[i], t) / d;
  }
  return result;
}

double axis_length(const Mat4& m, std::size_t axis) {
  const Vec3 v = column(m, axis);
  return std::sqrt(dot_product(v, v));
}

bool is_similarity(const Mat4& m) {
  const double length = axis_length(m, 0);
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(std::abs(axis_length(m, i) - length) <= 1e-4 * length)) return false;
    if (!(std::abs(dot_product(column(m, i), column(m, (i + 1) % 3))) <= 1e-4 * length * length))
      return false;
  }
  return length > 0;
}

bool swaps_handedness(const Mat4& m) {
  return determinant(m) < 0;
}

Vec3 transform_vector(const Mat4& m, const Vec3& v) {
  Vec3 result{};
  for (std::size_t i = 0; i < 3; ++i) result[i] = m[4 * i] * v[0] + m[4 * i + 1] * v[1] + m[4 * i + 2] * v[2];
  return result;
}

Vec3 transform_point(const Mat4& m, const Vec3& p) {
  Vec3 result = transform_vector(m, p);
  for (std::size_t i = 0; i < 3; ++i) result[i] += m[4 * i + 3];
  return result;
}

double cosine_degrees(double degrees) {
  return (*transform::rotate({0, 0, 1}, degrees))[0];
}

double tangent_degrees(double degrees) {
  const Mat4 turn = *transform::rotate({0, 0, 1}, degrees);
  return turn[4] / turn[0];
}

}  // namespace candela::description::pbrt
