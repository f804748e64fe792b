// Pairs and 2 x 2 matrices of doubles.
#pragma once

#include <cmath>

#include "worker/core/vec.h"

namespace candela::transport::manifold {

struct Pair {
  double x = 0, y = 0;
  friend constexpr Pair operator+(Pair a, Pair b) { return {a.x + b.x, a.y + b.y}; }
  friend constexpr Pair operator-(Pair a, Pair b) { return {a.x - b.x, a.y - b.y}; }
  friend constexpr Pair operator*(Pair a, double s) { return {a.x * s, a.y * s}; }
  friend constexpr bool operator==(const Pair&, const Pair&) = default;
};
constexpr double dot(Pair a, Pair b) {
  return a.x * b.x + a.y * b.y;
}
inline double max_abs(Pair a) {
  return std::max(std::abs(a.x), std::abs(a.y));
}

// Rows (xx, xy) and (yx, yy).
struct Mat2 {
  double xx = 0, xy = 0, yx = 0, yy = 0;
  friend constexpr Mat2 operator+(const Mat2& a, const Mat2& b) {
    return {a.xx + b.xx, a.xy + b.xy, a.yx + b.yx, a.yy + b.yy};
  }
  friend constexpr Mat2 operator-(const Mat2& a, const Mat2& b) {
    return {a.xx - b.xx, a.xy - b.xy, a.yx - b.yx, a.yy - b.yy};
  }
  friend constexpr Mat2 operator*(const Mat2& a, double s) {
    return {a.xx * s, a.xy * s, a.yx * s, a.yy * s};
  }
  friend constexpr Mat2 operator*(const Mat2& a, const Mat2& b) {
    return {a.xx * b.xx + a.xy * b.yx, a.xx * b.xy + a.xy * b.yy, a.yx * b.xx + a.yy * b.yx,
            a.yx * b.xy + a.yy * b.yy};
  }
  friend constexpr Pair operator*(const Mat2& a, Pair v) {
    return {a.xx * v.x + a.xy * v.y, a.yx * v.x + a.yy * v.y};
  }
  constexpr Mat2 operator-() const { return {-xx, -xy, -yx, -yy}; }
};
constexpr double det(const Mat2& m) {
  return m.xx * m.yy - m.xy * m.yx;
}
constexpr double norm_squared(const Mat2& m) {
  return m.xx * m.xx + m.xy * m.xy + m.yx * m.yx + m.yy * m.yy;
}
constexpr Mat2 transposed(const Mat2& m) {
  return {m.xx, m.yx, m.xy, m.yy};
}
// Precondition: the determinant is not zero.
constexpr Mat2 inverse(const Mat2& m) {
  const double d = det(m);
  return {m.yy / d, -m.xy / d, -m.yx / d, m.xx / d};
}

}  // namespace candela::transport::manifold
