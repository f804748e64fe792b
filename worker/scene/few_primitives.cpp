#include "worker/scene/few_primitives.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "worker/scene/bounds.h"
#include "worker/scene/shapes/geometry_steps.h"
#include "worker/scene/shapes/rounding.h"

namespace candela::scene {
namespace {

// Measured on a box with more and more cubes in it: beyond that Embree's tree is about as fast.
constexpr std::size_t kMaxTriangleBlocks = 8;
// Embree calls back for each round primitive, so that many of them pay.
constexpr std::size_t kMaxRound = 32;

// The longest edge over the height on it.
constexpr double kThinnest = 1e4;

inline __m256 along(const std::array<std::array<float, 8>, 3>& row, __m256 x, __m256 y, __m256 last) {
  return _mm256_fmadd_ps(_mm256_load_ps(row[0].data()), x,
                         _mm256_fmadd_ps(_mm256_load_ps(row[1].data()), y, last));
}

}  // namespace

// With u = 2^-24, r_k the sum of the magnitudes of row k, and A_k = r_k |origin| + |shift k|: a coordinate of
// the origin is wrong by at most 5 u A_k, one of the direction by 4 u r_k. So the volume x_o z_d - z_o x_d is
// wrong by 11 u (A_x r_z + A_z r_x), and the third volume by twice as much and 4 u r_z.
bool FewPrimitives::set_lane(const std::array<Vec3, 3>& corners, std::size_t lane, Block& block) {
  const Vec3d v0(corners[0]), e1 = Vec3d(corners[1]) - v0, e2 = Vec3d(corners[2]) - v0, n = cross(e1, e2);
  const double area = length(n),
               longest = std::max({length_squared(e1), length_squared(e2), length_squared(e2 - e1)});
  if (area == 0) return true;  // no ray meets it
  if (!(longest <= kThinnest * area)) return false;
  // The inverse of the matrix with the columns e1, e2 and n / |n|.
  const Vec3d rows[3] = {cross(e2, n) / (area * area), cross(n, e1) / (area * area), n / area};
  double sums[3], shifts[3];
  for (std::size_t k = 0; k < 3; ++k) {
    sums[k] = std::abs(rows[k].x) + std::abs(rows[k].y) + std::abs(rows[k].z);
    shifts[k] = -dot(rows[k], v0);
    block.rows[k][0][lane] = static_cast<float>(rows[k].x);
    block.rows[k][1][lane] = static_cast<float>(rows[k].y);
    block.rows[k][2][lane] = static_cast<float>(rows[k].z);
    block.shift[k][lane] = static_cast<float>(shifts[k]);
  }
  constexpr auto kUlp = static_cast<double>(kHalfUlp);
  double slope = 0, constant = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    slope = std::max(slope, 2 * sums[k] * sums[2]);
    constant = std::max(constant, std::abs(shifts[k]) * sums[2] + std::abs(shifts[2]) * sums[k]);
  }
  slope = kUlp * (32 * slope + 8 * sums[2]);
  constant = kUlp * (32 * constant + 8 * sums[2] + 8 * std::abs(shifts[2]));
  block.error_slope[lane] = static_cast<float>(slope);
  block.error_constant[lane] = static_cast<float>(constant);
  const Vec3 middle((v0 + Vec3d(corners[1]) + Vec3d(corners[2])) / 3);
  block.middle[0][lane] = middle.x;
  block.middle[1][lane] = middle.y;
  block.middle[2][lane] = middle.z;
  for (const Vec3& corner : corners) block.reach[lane] = std::max(block.reach[lane], length(corner - middle));
  return slope + constant < 1e15 && longest > 1e-15;
}

bool FewPrimitives::take_triangles(std::size_t count) {
  const std::size_t blocks = (count + kWidth - 1) / kWidth;
  if (blocks > kMaxTriangleBlocks) return false;
  Block empty;
  for (auto& row : empty.rows)
    for (Lanes& lanes : row) lanes.fill(0);
  for (Lanes& lanes : empty.shift) lanes.fill(0);
  empty.error_slope.fill(0);
  empty.error_constant.fill(std::numeric_limits<float>::quiet_NaN());
  for (Lanes& lanes : empty.middle) lanes.fill(std::numeric_limits<float>::quiet_NaN());
  empty.reach.fill(0);
  blocks_.assign(blocks, empty);
  exact_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto corners = corners_of(geometry_, static_cast<std::uint32_t>(i));
    if (!set_lane(corners, i % kWidth, blocks_[i / kWidth])) {
      blocks_.clear();
      return false;
    }
    const Vec3d v0(corners[0]);
    exact_.push_back({v0, cross(Vec3d(corners[1]) - v0, Vec3d(corners[2]) - v0)});
  }
  return true;
}

std::unique_ptr<FewPrimitives> FewPrimitives::build(const Geometry& geometry) {
  const Group& scene = geometry.groups[0];
  const auto count = [&](PrimitiveKind kind) {
    return scene.primitives[static_cast<std::size_t>(kind)].count;
  };
  const std::uint32_t spheres = count(PrimitiveKind::sphere), disks = count(PrimitiveKind::disk),
                      cylinders = count(PrimitiveKind::cylinder);
  if (spheres + disks + cylinders > kMaxRound) return nullptr;
  std::unique_ptr<FewPrimitives> few(new FewPrimitives(geometry));
  few->whole_ = geometry.instances.empty() && few->take_triangles(count(PrimitiveKind::triangle));
  if (!few->whole_ && spheres + disks + cylinders == 0) return nullptr;
  for (std::uint32_t i = 0; i < spheres; ++i) {
    const Sphere& sphere = geometry.spheres[i].sphere;
    few->add_round(PrimitiveKind::sphere, i, sphere.center, sphere.radius);
  }
  for (std::uint32_t i = 0; i < disks; ++i) {
    const Disk& disk = geometry.disks[i].disk;
    few->add_round(PrimitiveKind::disk, i, disk.center, disk.radius);
  }
  for (std::uint32_t i = 0; i < cylinders; ++i) {
    const Cylinder& cylinder = geometry.cylinders[i].cylinder;
    few->add_round(PrimitiveKind::cylinder, i, cylinder.base + cylinder.axes[2] * (cylinder.length / 2),
                   std::sqrt(cylinder.radius * cylinder.radius + cylinder.length * cylinder.length / 4));
  }
  few->surround();
  return few;
}

void FewPrimitives::surround() {
  if (round_.empty()) return;
  const auto center_of = [&](std::size_t i) {
    const auto& center = balls_[i / kWidth].center;
    return Vec3d(Vec3{center[0][i % kWidth], center[1][i % kWidth], center[2][i % kWidth]});
  };
  Bounds box;
  for (std::size_t i = 0; i < round_.size(); ++i) box.add(center_of(i));
  middle_ = Vec3(box.center());
  double reach = 0;
  for (std::size_t i = 0; i < round_.size(); ++i)
    reach = std::max(reach, length(center_of(i) - Vec3d(middle_)) +
                                static_cast<double>(balls_[i / kWidth].radius[i % kWidth]));
  reach_ = static_cast<float>(reach * (1 + 1e-6));
  extent_ = std::abs(middle_.x) + std::abs(middle_.y) + std::abs(middle_.z) + reach_;
}

void FewPrimitives::add_round(PrimitiveKind kind, std::uint32_t primitive, const Vec3d& center,
                              double radius) {
  const std::size_t lane = round_.size() % kWidth;
  if (lane == 0) {
    Balls& none = balls_.emplace_back();
    for (Lanes* lanes : {&none.center[0], &none.center[1], &none.center[2], &none.radius, &none.extent})
      lanes->fill(0);
    for (Lanes* lanes : {&none.radius_squared, &none.hollow})
      lanes->fill(std::numeric_limits<float>::quiet_NaN());
  }
  round_.push_back({kind, primitive});
  Balls& balls = balls_.back();
  balls.center[0][lane] = static_cast<float>(center.x);
  balls.center[1][lane] = static_cast<float>(center.y);
  balls.center[2][lane] = static_cast<float>(center.z);
  balls.radius[lane] = static_cast<float>(radius);
  balls.radius_squared[lane] = static_cast<float>(radius * radius);
  balls.hollow[lane] = kind == PrimitiveKind::sphere ? balls.radius[lane] : 0;
  balls.extent[lane] =
      static_cast<float>(std::abs(center.x) + std::abs(center.y) + std::abs(center.z) + radius);
}

bool FewPrimitives::meets_round(const Round& round, const Vec3d& origin, const Vec3d& direction, double end,
                                double& t) const {
  if (round.kind == PrimitiveKind::sphere)
    return meet(geometry_.spheres[round.primitive].sphere, origin, direction, 0, end, t);
  if (round.kind == PrimitiveKind::disk)
    return meet(geometry_.disks[round.primitive].disk, origin, direction, 0, end, t);
  return meet(geometry_.cylinders[round.primitive].cylinder, origin, direction, 0, end, t);
}

bool FewPrimitives::passes_inside(const Vec3d& origin, const Vec3d& direction, std::uint32_t triangle) const {
  const Triangle& t = geometry_.triangles[triangle];
  const Vec3d v0 = Vec3d(t.v0) - origin, v1 = Vec3d(t.v1) - origin, v2 = Vec3d(t.v2) - origin;
  // If an edge turns, its volume turns its sign, to the last bit.
  const double u = dot(cross(v2 - v0, v2 + v0), direction), v = dot(cross(v0 - v1, v0 + v1), direction),
               w = dot(cross(v1 - v2, v1 + v2), direction);
  return std::min({u, v, w}) >= 0 || std::max({u, v, w}) <= 0;
}

template <class Met>
[[gnu::always_inline]] inline bool FewPrimitives::for_each_met(const Ray& ray, const double& end,
                                                               const Met& met) const {
  const Vec3 o = ray.origin, d = ray.direction;
  const Vec3d origin(o), direction(d);
  const __m256 ox = _mm256_set1_ps(o.x), oy = _mm256_set1_ps(o.y), oz = _mm256_set1_ps(o.z),
               dx = _mm256_set1_ps(d.x), dy = _mm256_set1_ps(d.y), dz = _mm256_set1_ps(d.z);
  const __m256 far = _mm256_set1_ps(std::max({std::abs(o.x), std::abs(o.y), std::abs(o.z)})),
               sign_bit = _mm256_set1_ps(-0.0f);
  std::uint32_t first = 0;
  for (const Block& block : blocks_) {
    // Heights over the plane: of the origin, and how the direction changes them.
    const __m256 hz = along(block.rows[2], ox, oy,
                            _mm256_fmadd_ps(_mm256_load_ps(block.rows[2][2].data()), oz,
                                            _mm256_load_ps(block.shift[2].data()))),
                 fz =
                     along(block.rows[2], dx, dy, _mm256_mul_ps(_mm256_load_ps(block.rows[2][2].data()), dz));
    const __m256 sign = _mm256_and_ps(fz, sign_bit), fall = _mm256_xor_ps(fz, sign);
    const auto volume = [&](std::size_t k) {
      const __m256 h = along(block.rows[k], ox, oy,
                             _mm256_fmadd_ps(_mm256_load_ps(block.rows[k][2].data()), oz,
                                             _mm256_load_ps(block.shift[k].data()))),
                   f = along(block.rows[k], dx, dy,
                             _mm256_mul_ps(_mm256_load_ps(block.rows[k][2].data()), dz));
      return _mm256_xor_ps(_mm256_fmsub_ps(h, fz, _mm256_mul_ps(hz, f)), sign);
    };
    const __m256 u = volume(0), v = volume(1), w = _mm256_sub_ps(_mm256_sub_ps(fall, u), v);
    const __m256 error = _mm256_fmadd_ps(_mm256_load_ps(block.error_slope.data()), far,
                                         _mm256_load_ps(block.error_constant.data()));
    const __m256 least = _mm256_min_ps(_mm256_min_ps(u, v), w),
                 depth = _mm256_xor_ps(hz, _mm256_xor_ps(sign, sign_bit));  // distance times fall
    // The end's factor also bounds the rounding of the end to float, and the error of the fall.
    const __m256 deepest = _mm256_fmadd_ps(_mm256_set1_ps(static_cast<float>(end)),
                                           _mm256_add_ps(fall, _mm256_set1_ps(0x1p-20f)), error);
    const __m256 perhaps =
        _mm256_and_ps(_mm256_cmp_ps(_mm256_min_ps(least, depth), _mm256_xor_ps(error, sign_bit), _CMP_GE_OQ),
                      _mm256_cmp_ps(depth, deepest, _CMP_LE_OQ));
    auto lanes = static_cast<unsigned>(_mm256_movemask_ps(perhaps));
    if (lanes != 0) {
      const auto sure = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(least, error, _CMP_GT_OQ)));
      do {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
        const std::uint32_t i = first + lane;
        const Exact& exact = exact_[i];
        const double slope = dot(direction, exact.normal);
        const double t = dot(exact.corner - origin, exact.normal) / slope;
        if (slope != 0 && ((sure >> lane & 1) != 0 || passes_inside(origin, direction, i)) &&
            met(PrimitiveKind::triangle, i, t))
          return true;
        lanes &= lanes - 1;
      } while (lanes != 0);
    }
    first += kWidth;
  }
  first = 0;
  for (const Balls& balls : balls_) {
    // From the ball's center to the origin, and to the place where the ray comes closest.
    const __m256 fx = _mm256_sub_ps(ox, _mm256_load_ps(balls.center[0].data())),
                 fy = _mm256_sub_ps(oy, _mm256_load_ps(balls.center[1].data())),
                 fz = _mm256_sub_ps(oz, _mm256_load_ps(balls.center[2].data()));
    const __m256 away = _mm256_fmadd_ps(fx, dx, _mm256_fmadd_ps(fy, dy, _mm256_mul_ps(fz, dz)));
    const __m256 cx = _mm256_fnmadd_ps(away, dx, fx), cy = _mm256_fnmadd_ps(away, dy, fy),
                 cz = _mm256_fnmadd_ps(away, dz, fz);
    const auto squares = [](__m256 x, __m256 y, __m256 z) {
      return _mm256_fmadd_ps(x, x, _mm256_fmadd_ps(y, y, _mm256_mul_ps(z, z)));
    };
    // Coordinates, and so `away`, are wrong by a few 2^-24 of the size.
    const __m256 size = _mm256_fmadd_ps(far, _mm256_set1_ps(3.0f), _mm256_load_ps(balls.extent.data()));
    const __m256 limit = _mm256_fmadd_ps(_mm256_mul_ps(size, size), _mm256_set1_ps(kSquareError),
                                         _mm256_load_ps(balls.radius_squared.data()));
    const __m256 beyond =
        _mm256_fmadd_ps(size, _mm256_set1_ps(kSquareError),
                        _mm256_fmadd_ps(_mm256_set1_ps(static_cast<float>(end)), _mm256_set1_ps(1 + 0x1p-20f),
                                        _mm256_load_ps(balls.radius.data())));
    const __m256 outside = _mm256_sub_ps(squares(fx, fy, fz), limit);
    const __m256 perhaps = _mm256_and_ps(
        _mm256_and_ps(_mm256_cmp_ps(squares(cx, cy, cz), limit, _CMP_LE_OQ),
                      _mm256_cmp_ps(_mm256_min_ps(away, outside), _mm256_setzero_ps(), _CMP_LE_OQ)),
        _mm256_cmp_ps(_mm256_xor_ps(away, sign_bit), beyond, _CMP_LE_OQ));
    for (auto lanes = static_cast<unsigned>(_mm256_movemask_ps(perhaps)); lanes != 0; lanes &= lanes - 1) {
      const Round& round = round_[first + static_cast<std::uint32_t>(std::countr_zero(lanes))];
      double t = 0;
      if (meets_round(round, origin, direction, end, t) && met(round.kind, round.primitive, t)) return true;
    }
    first += kWidth;
  }
  return false;
}

bool FewPrimitives::intersect(const Ray& ray, float& distance, PrimitiveKind& kind,
                              std::uint32_t& primitive) const {
  auto nearest = static_cast<double>(ray.t_max);
  bool found = false;
  for_each_met(ray, nearest, [&](PrimitiveKind met, std::uint32_t index, double t) {
    if (!(t >= 0 && t < nearest)) return false;
    nearest = t;
    kind = met;
    primitive = index;
    found = true;
    return false;
  });
  distance = static_cast<float>(nearest);
  return found;
}

bool FewPrimitives::occluded(const Ray& ray) const {
  const auto end = static_cast<double>(ray.t_max);
  return for_each_met(ray, end, [&](PrimitiveKind, std::uint32_t, double t) { return t >= 0 && t < end; });
}

float FewPrimitives::clearance(Vec3 p, float limit) const {
  const __m256 x = _mm256_set1_ps(p.x), y = _mm256_set1_ps(p.y), z = _mm256_set1_ps(p.z),
               sign_bit = _mm256_set1_ps(-0.0f);
  const auto from = [&](const std::array<Lanes, 3>& center) {
    const __m256 fx = _mm256_sub_ps(x, _mm256_load_ps(center[0].data())),
                 fy = _mm256_sub_ps(y, _mm256_load_ps(center[1].data())),
                 fz = _mm256_sub_ps(z, _mm256_load_ps(center[2].data()));
    return _mm256_sqrt_ps(_mm256_fmadd_ps(fx, fx, _mm256_fmadd_ps(fy, fy, _mm256_mul_ps(fz, fz))));
  };
  // _mm256_min_ps returns its second argument if one is not a number, so that empty lanes do not count.
  __m256 least = _mm256_set1_ps(limit);
  for (const Block& block : blocks_) {
    const __m256 height = along(
        block.rows[2], x, y,
        _mm256_fmadd_ps(_mm256_load_ps(block.rows[2][2].data()), z, _mm256_load_ps(block.shift[2].data())));
    const __m256 off = _mm256_sub_ps(from(block.middle), _mm256_load_ps(block.reach.data()));
    least = _mm256_min_ps(_mm256_max_ps(_mm256_andnot_ps(sign_bit, height), off), least);
  }
  for (const Balls& balls : balls_) {
    const __m256 away = from(balls.center);
    least = _mm256_min_ps(_mm256_max_ps(_mm256_sub_ps(away, _mm256_load_ps(balls.radius.data())),
                                        _mm256_sub_ps(_mm256_load_ps(balls.hollow.data()), away)),
                          least);
  }
  alignas(32) Lanes lanes;
  _mm256_store_ps(lanes.data(), least);
  return std::max(0.0f, *std::min_element(lanes.begin(), lanes.end()));
}

}  // namespace candela::scene
