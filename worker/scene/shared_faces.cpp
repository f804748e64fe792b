#include "worker/scene/shared_faces.h"

#include <algorithm>
#include <array>
#include <set>
#include <tuple>

#include "common/base/work_monitor.h"
#include "worker/scene/bounds.h"
#include "worker/scene/shapes/geometry_steps.h"
#include "worker/scene/ties.h"

namespace candela::scene {
namespace {

constexpr std::size_t kMaxComparisons = std::size_t{1} << 22;

// A convex polygon in the plane of others.
struct Polygon {
  std::uint32_t plane, shape;
  std::vector<Vec3d> corners;
  Vec3d normal;
  Bounds box;
};

Polygon polygon_of(const Geometry& geometry, const Contested& what) {
  Polygon out{what.plane, what.shape, {}, {}, {}};
  if (what.kind == PrimitiveKind::triangle) {
    for (const Vec3& corner : corners_of(geometry, what.primitive)) out.corners.push_back(Vec3d(corner));
    out.normal = cross(out.corners[1] - out.corners[0], out.corners[2] - out.corners[0]);
  } else {
    const Disk& disk = geometry.disks[what.primitive].disk;
    constexpr double kDiagonal = 0.70710678118654752;
    constexpr std::array<std::array<double, 2>, 8> kOctagon = {{{1, 0},
                                                                {kDiagonal, kDiagonal},
                                                                {0, 1},
                                                                {-kDiagonal, kDiagonal},
                                                                {-1, 0},
                                                                {-kDiagonal, -kDiagonal},
                                                                {0, -1},
                                                                {kDiagonal, -kDiagonal}}};
    for (const auto& [u, v] : kOctagon)
      out.corners.push_back(disk.center + (disk.axes[0] * u + disk.axes[1] * v) * disk.radius);
    out.normal = disk.axes[2];
  }
  for (const Vec3d& corner : out.corners) out.box.add(corner);
  return out;
}

// True if the projections on each side's normal in the plane have more than an edge in common.
bool overlap_beside(const Polygon& a, const Polygon& b) {
  for (std::size_t i = 0; i < a.corners.size(); ++i) {
    const Vec3d side = a.corners[(i + 1) % a.corners.size()] - a.corners[i];
    const Vec3d axis = cross(side, a.normal);
    const double l = length(axis);
    if (!(l > 0)) continue;
    double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
    const Polygon* both[2] = {&a, &b};
    for (std::size_t k = 0; k < 2; ++k)
      for (const Vec3d& corner : both[k]->corners) {
        const double x = dot(corner - a.corners[i], axis) / l;
        low[k] = std::min(low[k], x);
        high[k] = std::max(high[k], x);
      }
    const double common = std::min(high[0], high[1]) - std::max(low[0], low[1]);
    // A hundredth of the smaller one: faces that only touch are no shared ones.
    if (!(common > 0.01 * std::min(high[0] - low[0], high[1] - low[1]))) return false;
  }
  return true;
}

}  // namespace

std::vector<std::pair<std::uint32_t, std::uint32_t>> find_shared_faces(const Geometry& geometry,
                                                                       const std::vector<bool>& looked_at,
                                                                       std::size_t most) {
  std::vector<Polygon> polygons;
  for (const Contested& what : find_contested(geometry, &looked_at))
    polygons.push_back(polygon_of(geometry, what));
  std::sort(polygons.begin(), polygons.end(), [](const Polygon& a, const Polygon& b) {
    return std::tie(a.plane, a.box.low.x, a.shape) < std::tie(b.plane, b.box.low.x, b.shape);
  });
  std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;
  std::size_t comparisons = 0;
  for (std::size_t i = 0; i < polygons.size() && pairs.size() < most; ++i) {
    work_step();
    const Polygon& a = polygons[i];
    for (std::size_t j = i + 1; j < polygons.size() && polygons[j].plane == a.plane &&
                                polygons[j].box.low.x <= a.box.high.x && pairs.size() < most;
         ++j) {
      if (++comparisons > kMaxComparisons) return {pairs.begin(), pairs.end()};
      const Polygon& b = polygons[j];
      if (a.shape == b.shape) continue;
      const auto pair = std::minmax(a.shape, b.shape);
      if (!pairs.contains(pair) && overlap_beside(a, b) && overlap_beside(b, a)) pairs.insert(pair);
    }
  }
  return {pairs.begin(), pairs.end()};
}

}  // namespace candela::scene
