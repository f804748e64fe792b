// An affine map in double: vertices are rounded to float once, after everything has been applied.
#pragma once

#include <array>
#include <cmath>

#include "common/description/object.h"
#include "worker/core/vec.h"

namespace candela::scene {

class Transform {
 public:
  // Row-major, acting on column vectors. The fourth row is taken as (0, 0, 0, 1), as Mitsuba does for shapes.
  explicit Transform(const description::Mat4& m) {
    for (std::size_t row = 0; row < 3; ++row) {
      linear_[row] = {m[4 * row], m[4 * row + 1], m[4 * row + 2]};
      translation_[row] = m[4 * row + 3];
    }
    // The rows of the cofactor matrix are cross products of the rows of the linear part; cofactor / det is
    // the inverse transposed.
    cofactor_ = {cross(linear_[1], linear_[2]), cross(linear_[2], linear_[0]), cross(linear_[0], linear_[1])};
    determinant_ = dot(linear_[0], cofactor_[0]);
  }

  Vec3d point(Vec3d p) const {
    return {dot(linear_[0], p) + translation_[0], dot(linear_[1], p) + translation_[1],
            dot(linear_[2], p) + translation_[2]};
  }
  Vec3d vector(Vec3d v) const { return {dot(linear_[0], v), dot(linear_[1], v), dot(linear_[2], v)}; }
  // Inverse transposed up to a positive factor: right for normals under mirrors too. Not normalized.
  Vec3d normal(Vec3d n) const {
    const Vec3d v{dot(cofactor_[0], n), dot(cofactor_[1], n), dot(cofactor_[2], n)};
    return determinant_ < 0 ? -v : v;
  }
  // The inverse map; the determinant is not zero.
  Vec3d inverse_point(Vec3d p) const { return inverse_vector(p - translation()); }
  Vec3d inverse_vector(Vec3d v) const {
    return (cofactor_[0] * v.x + cofactor_[1] * v.y + cofactor_[2] * v.z) / determinant_;
  }
  // The inverse transposed itself, for lengths: a step h along the world normal there climbs h |v| over the
  // surface here.
  Vec3d covector(Vec3d n) const {
    return Vec3d{dot(cofactor_[0], n), dot(cofactor_[1], n), dot(cofactor_[2], n)} / determinant_;
  }
  Vec3d column(int i) const { return {linear_[0][i], linear_[1][i], linear_[2][i]}; }
  Vec3d translation() const { return {translation_[0], translation_[1], translation_[2]}; }
  double determinant() const { return determinant_; }

  // The columns are orthogonal and of one length, to a relative tolerance of 1e-4 (text of six digits is
  // accepted).
  bool is_similarity() const {
    const Vec3d a = column(0), b = column(1), c = column(2);
    const double la = length(a), lb = length(b), lc = length(c);
    const double tolerance = 1e-4 * la;
    return std::abs(la - lb) <= tolerance && std::abs(la - lc) <= tolerance &&
           std::abs(dot(a, b)) <= tolerance * la && std::abs(dot(a, c)) <= tolerance * la &&
           std::abs(dot(b, c)) <= tolerance * la;
  }

 private:
  std::array<Vec3d, 3> linear_{}, cofactor_{};
  std::array<double, 3> translation_{};
  double determinant_ = 0;
};

}  // namespace candela::scene
