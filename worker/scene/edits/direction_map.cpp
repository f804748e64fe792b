#include "worker/scene/edits/direction_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

Vec3d vector_of(const edits::Triple& v) {
  return {v[0], v[1], v[2]};
}

Matrix3 rotation_about(Vec3d axis, double degrees) {
  double sine = 0, cosine = 1;
  math::sincos(degrees * (std::numbers::pi / 180), sine, cosine);
  const Vec3d k = axis / length(axis);
  Matrix3 q;
  // Rodrigues: v cos + (k x v) sin + k (k.v) (1 - cos), row by row
  for (int i = 0; i < 3; ++i) {
    const Vec3d unit{i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0};
    q.rows[i] = unit * cosine + cross(unit, k) * sine + k * (k[i] * (1 - cosine));
  }
  return q;
}

}  // namespace

Matrix3 Matrix3::inverse() const {
  const Vec3d a = cross(rows[1], rows[2]), b = cross(rows[2], rows[0]), c = cross(rows[0], rows[1]);
  const double scale = 1 / determinant();
  Matrix3 out;
  out.rows[0] = Vec3d{a.x, b.x, c.x} * scale;
  out.rows[1] = Vec3d{a.y, b.y, c.y} * scale;
  out.rows[2] = Vec3d{a.z, b.z, c.z} * scale;
  return out;
}

DirectionMap direction_map(const edits::Edit& edit) {
  DirectionMap map;
  map.turns = edit.rotate || edit.move;
  if (edit.rotate) map.linear = rotation_about(vector_of(edit.rotate->axis), edit.rotate->degrees);
  if (edit.move) {
    for (std::size_t i = 0; i < 3; ++i)
      map.linear.rows[i] = {edit.move->linear[3 * i], edit.move->linear[3 * i + 1],
                            edit.move->linear[3 * i + 2]};
    map.moves = true;
    map.from = vector_of(edit.move->from);
    map.to = vector_of(edit.move->to);
    map.facing = !edit.move->normal;
    if (edit.move->normal) map.normal = vector_of(*edit.move->normal);
  }
  map.inverse = map.linear.inverse();
  map.determinant = map.linear.determinant();
  return map;
}

bool MapAtVertex::set(const DirectionMap& map, Vec3d x) {
  map_ = &map;
  determinant_ = map.determinant;
  m_ = add_ = add_back_ = {};
  if (!map.moves) return true;
  const Vec3d d = map.from - x, e = map.to - x, back_e = map.inverse * e;
  m_ = map.facing ? d : map.normal;
  const double along_d = dot(m_, d), along_e = dot(m_, back_e), m = length(m_);
  if (!(std::abs(along_d) > kSingularCosine * m * length(d)) ||
      !(std::abs(along_e) > kSingularCosine * m * length(back_e)))
    return false;
  add_ = (e - map.linear * d) * (1 / along_d);
  add_back_ = (back_e - d) * (1 / along_e);
  determinant_ = map.determinant * along_e / along_d;
  return true;
}

Vec3d MapAtVertex::forward(Vec3d w) const {
  return normalize(map_->linear * w + add_ * dot(m_, w));
}

Vec3d MapAtVertex::backward(Vec3d o, double& jacobian) const {
  const Vec3d v = map_->inverse * o;
  const Vec3d r = v - add_back_ * dot(m_, v);
  const double l = length(r);
  jacobian = 1 / (std::abs(determinant_) * l * l * l);
  return r * (1 / l);
}

Cone cone_of(const letters::Region& region) {
  Cone cone;
  cone.everywhere = false;
  cone.sphere = region.kind == letters::Region::Kind::sphere;
  cone.low = vector_of(region.low);
  cone.high = vector_of(region.high);
  cone.radius = region.radius;
  return cone;
}

Cone cone_of(const edits::EditList& list, const edits::Edit& edit) {
  const letters::Region* region = edit.source.empty() ? nullptr : list.region(edit.source);
  return region == nullptr ? Cone() : cone_of(*region);
}

bool encloses(const Cone& cone, Vec3d p) {
  if (cone.everywhere) return true;
  if (cone.sphere) return length_squared(p - cone.low) <= cone.radius * cone.radius;
  for (int i = 0; i < 3; ++i)
    if (p[i] < cone.low[i] || p[i] > cone.high[i]) return false;
  return true;
}

bool contains(const Cone& cone, Vec3d x, Vec3d w) {
  if (cone.everywhere) return true;
  if (cone.sphere) {
    const Vec3d c = cone.low - x;
    const double outside = length_squared(c) - cone.radius * cone.radius, along = dot(c, w);
    return outside <= 0 || (along > 0 && along * along >= outside);
  }
  double near = 0, far = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    if (w[i] == 0) {
      if (x[i] < cone.low[i] || x[i] > cone.high[i]) return false;
      continue;
    }
    const double a = (cone.low[i] - x[i]) / w[i], b = (cone.high[i] - x[i]) / w[i];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  return near <= far;
}

}  // namespace candela::scene
