#include "common/description/transform.h"

#include <cmath>
#include <numbers>

namespace candela::description::transform {
namespace {

Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double largest(const Vec3& v) {
  return std::fmax(std::fabs(v[0]), std::fmax(std::fabs(v[1]), std::fabs(v[2])));
}

// Scaled first, so that neither tiny nor huge vectors lose their length.
std::optional<Vec3> normalize(const Vec3& v) {
  const double big = largest(v);
  if (!(big > 0) || !std::isfinite(big)) return std::nullopt;
  const Vec3 w = {v[0] / big, v[1] / big, v[2] / big};
  const double length = std::sqrt(dot(w, w));
  return Vec3{w[0] / length, w[1] / length, w[2] / length};
}

struct SinCos {
  double sin, cos;
};

// Reduced exactly to [-45, 45] degrees; there the Taylor series' first left-out term is below 1e-17.
SinCos sin_cos_degrees(double degrees) {
  const double reduced = std::fmod(degrees, 360.0);  // exact by IEEE 754
  const long quarter = std::lround(reduced / 90.0);
  const double x = (reduced - 90.0 * static_cast<double>(quarter)) * (std::numbers::pi / 180.0);
  const double x2 = x * x;
  double sin = 0;
  double cos = 0;
  for (int n = 17; n >= 3; n -= 2) sin = (1 + sin) * -x2 / (n * (n - 1));
  for (int n = 18; n >= 2; n -= 2) cos = (1 + cos) * -x2 / (n * (n - 1));
  sin = x + x * sin;
  cos = 1 + cos;
  switch (((quarter % 4) + 4) % 4) {
    case 0:
      return {sin, cos};
    case 1:
      return {cos, -sin};
    case 2:
      return {-sin, -cos};
    default:
      return {-cos, sin};
  }
}

}  // namespace

Mat4 multiply(const Mat4& a, const Mat4& b) {
  Mat4 result{};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j) {
      double sum = 0;
      for (std::size_t k = 0; k < 4; ++k) sum += a[i * 4 + k] * b[k * 4 + j];
      result[i * 4 + j] = sum;
    }
  return result;
}

Mat4 translate(const Vec3& by) {
  return {1, 0, 0, by[0], 0, 1, 0, by[1], 0, 0, 1, by[2], 0, 0, 0, 1};
}

Mat4 scale(const Vec3& by) {
  return {by[0], 0, 0, 0, 0, by[1], 0, 0, 0, 0, by[2], 0, 0, 0, 0, 1};
}

std::optional<Mat4> rotate(const Vec3& axis, double degrees) {
  const std::optional<Vec3> unit = normalize(axis);
  if (!unit) return std::nullopt;
  const auto [s, c] = sin_cos_degrees(degrees);
  const auto [x, y, z] = *unit;
  const double t = 1 - c;
  return Mat4{c + x * x * t,
              x * y * t - z * s,
              x * z * t + y * s,
              0,  //
              x * y * t + z * s,
              c + y * y * t,
              y * z * t - x * s,
              0,  //
              x * z * t - y * s,
              y * z * t + x * s,
              c + z * z * t,
              0,  //
              0,
              0,
              0,
              1};
}

std::optional<Mat4> look_at(const Vec3& origin, const Vec3& target, const Vec3& up) {
  const std::optional<Vec3> dir =
      normalize({target[0] - origin[0], target[1] - origin[1], target[2] - origin[2]});
  if (!dir) return std::nullopt;
  Vec3 above = up;
  if (largest(up) == 0) {
    // A tangent by Duff et al. 2017, "Building an Orthonormal Basis, Revisited": what Mitsuba takes then.
    const double sign = std::copysign(1.0, (*dir)[2]);
    const double a = -1 / (sign + (*dir)[2]);
    above = {1 + sign * (*dir)[0] * (*dir)[0] * a, sign * (*dir)[0] * (*dir)[1] * a, -sign * (*dir)[0]};
  }
  const std::optional<Vec3> unit_up = normalize(above);
  if (!unit_up) return std::nullopt;
  const Vec3 across = cross(*unit_up, *dir);
  if (largest(across) < 1e-12) return std::nullopt;
  const std::optional<Vec3> left = normalize(across);
  if (!left) return std::nullopt;
  const Vec3 y = cross(*dir, *left);
  return Mat4{(*left)[0], y[0], (*dir)[0], origin[0],  //
              (*left)[1], y[1], (*dir)[1], origin[1],  //
              (*left)[2], y[2], (*dir)[2], origin[2],  //
              0,          0,    0,         1};
}

bool is_invertible(const Mat4& m) {
  std::array<Vec3, 3> columns;
  for (std::size_t j = 0; j < 3; ++j) {
    const std::optional<Vec3> column = normalize({m[j], m[4 + j], m[8 + j]});
    if (!column) return false;
    columns[j] = *column;
  }
  return std::fabs(dot(columns[0], cross(columns[1], columns[2]))) > 1e-12;
}

bool is_affine(const Mat4& m) {
  return m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
}

bool is_finite(const Mat4& m) {
  for (const double value : m)
    if (!std::isfinite(value)) return false;
  return true;
}

bool is_similarity(const Mat4& m) {
  const auto column = [&](std::size_t j) { return Vec3{m[j], m[4 + j], m[8 + j]}; };
  const Vec3 a = column(0), b = column(1), c = column(2);
  const double length_a = std::sqrt(dot(a, a));
  const double slack = 1e-4 * length_a;
  return length_a > 0 && std::fabs(length_a - std::sqrt(dot(b, b))) <= slack &&
         std::fabs(length_a - std::sqrt(dot(c, c))) <= slack && std::fabs(dot(a, b)) <= slack * length_a &&
         std::fabs(dot(a, c)) <= slack * length_a && std::fabs(dot(b, c)) <= slack * length_a;
}

std::optional<Mat4> without_shear(const Mat4& m) {
  const auto column = [&](std::size_t j) { return normalize({m[j], m[4 + j], m[8 + j]}); };
  const std::optional<Vec3> x = column(0), y = column(1), z = column(2);
  if (!x || !y || !z) return std::nullopt;
  const double along = dot(*x, *z);
  const std::optional<Vec3> s =
      normalize({(*x)[0] - along * (*z)[0], (*x)[1] - along * (*z)[1], (*x)[2] - along * (*z)[2]});
  if (!s) return std::nullopt;
  Vec3 t = cross(*z, *s);
  if (dot(t, *y) < 0) t = {-t[0], -t[1], -t[2]};
  Mat4 rigid = {(*s)[0], t[0], (*z)[0], m[3],   //
                (*s)[1], t[1], (*z)[1], m[7],   //
                (*s)[2], t[2], (*z)[2], m[11],  //
                0,       0,    0,       1};
  for (double& value : rigid) value += 0.0;  // no negative zeros
  return rigid;
}

double srgb_to_linear(double encoded) {
  if (encoded <= 0.04045) return encoded / 12.92;
  const double x = (encoded + 0.055) / 1.055;
  // x^2.4 = x^2 (x^2)^(1/5), the root by Newton's method from above, where it converges steadily.
  const double square = x * x;
  double root = 1;
  for (int i = 0; i < 60; ++i) {
    const double fourth = root * root * root * root;
    root = (4 * root + square / fourth) / 5;
  }
  return square * root;
}

}  // namespace candela::description::transform
