// Ear clipping [Meisters 1975] in the plane of the polygon's normal.
//
// Coordinates are floats, so that twice the area of a triangle is nearly always exact in double. An ear is
// tested against all vertices in its bounding box, found by a grid. Touching edges need care: a vertex at a
// corner or on an edge of an ear hides it only if the outline goes on into the ear from there.
//
// Time: a corner that is no ear can only become one when a neighbor is clipped, so that there are at most 3 n
// tests. A test looks at the vertices near it: about n log n in all for usual outlines, n^2 for the worst.
#include "worker/loaders/polygon.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <deque>
#include <limits>
#include <numeric>

#include "common/base/work_monitor.h"
#include "worker/loaders/parallel.h"

namespace candela::loaders {
namespace {

constexpr std::uint64_t kMaxVisits = std::uint64_t{1} << 33;  // of vertices: some ten seconds
constexpr std::uint32_t kSmall = 32;                          // corners that need no grid

struct Point {
  double x = 0, y = 0;
  bool operator==(const Point&) const = default;
};

// Twice the signed area; above 0: c lies to the left of the line from a to b.
double area(Point a, Point b, Point c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

class Outline {
 public:
  // Projects the corners along the largest axis of the polygon's normal so that they turn left. False: the
  // polygon has no area.
  bool project(const std::vector<Vec3>& corners) {
    const Vec3d origin(corners[0]);
    Vec3d normal;
    for (std::size_t i = 1; i + 1 < corners.size(); ++i)
      normal += cross(Vec3d(corners[i]) - origin, Vec3d(corners[i + 1]) - origin);
    const double x = std::abs(normal.x), y = std::abs(normal.y), z = std::abs(normal.z);
    const double largest = std::max({x, y, z});
    if (!(largest > 0)) return false;
    points_.resize(corners.size());
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vec3d p(corners[i]);
      Point& q = points_[i];
      if (largest == z) {
        q = normal.z > 0 ? Point{p.x, p.y} : Point{p.y, p.x};
      } else if (largest == x) {
        q = normal.x > 0 ? Point{p.y, p.z} : Point{p.z, p.y};
      } else {
        q = normal.y > 0 ? Point{p.z, p.x} : Point{p.x, p.z};
      }
    }
    return true;
  }

  // The fan around the first corner covers the polygon: no triangle of it turns right, but for the rounding
  // of the coordinates.
  bool is_fan() const {
    double largest = 0, length = 0, wrong = 0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Point p = points_[i], q = points_[(i + 1) % points_.size()];
      largest = std::max({largest, std::abs(p.x), std::abs(p.y)});
      length += std::abs(q.x - p.x) + std::abs(q.y - p.y);
      if (i > 0 && i + 1 < points_.size()) wrong -= std::min(0.0, area(points_[0], p, q));
    }
    return wrong <= 0x1p-22 * largest * length;
  }

  // n - 2 triangles of corners. False: it would take too long.
  bool clip(Triangles& out) {
    const auto count = static_cast<std::uint32_t>(points_.size());
    alive_ = count;
    next_.resize(count);
    previous_.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) {
      next_[i] = (i + 1) % count;
      previous_[i] = (i + count - 1) % count;
    }
    out.clear();
    dead_.assign(count, false);
    turn_.assign(count, 0);
    first_ = 0;
    visits_ = 0;
    sort_into_cells();
    while (alive_ > 3) {
      const std::uint32_t before = alive_;
      if (!pass(true, out)) return false;
      // A polygon without an ear crosses itself.
      if (alive_ == before && !pass(false, out)) return false;
    }
    out.push_back(triangle_at(first_alive()));
    return true;
  }

 private:
  std::array<std::uint32_t, 3> triangle_at(std::uint32_t b) const { return {previous_[b], b, next_[b]}; }

  std::uint32_t first_alive() {
    while (dead_[first_]) ++first_;
    return first_;
  }

  // Clips ears, and spikes first. If not strict, all corners that do not turn right, or one if there is none.
  bool pass(bool strict, Triangles& out) {
    queue_.clear();
    visits_ += alive_;
    for (std::uint32_t v = first_alive(), i = 0; i < alive_; ++i, v = next_[v]) push(v);
    std::uint32_t clipped = 0;
    for (std::size_t step = 0; !queue_.empty() && alive_ > 3; ++step) {
      work_step(step);
      const auto [v, turn] = queue_.front();
      queue_.pop_front();
      if (dead_[v] || turn_[v] != turn) continue;  // a neighbor was clipped since: it stands elsewhere again
      const bool clips = strict ? is_spike(v) || is_ear(v) : turns(v) >= 0;
      if (visits_ > kMaxVisits) return false;
      if (!clips) continue;
      out.push_back(triangle_at(v));
      clip_off(v);
      ++clipped;
    }
    if (!strict && clipped == 0 && alive_ > 3) {
      const std::uint32_t v = first_alive();
      out.push_back(triangle_at(v));
      clip_off(v);
    }
    return true;
  }

  // A spike goes first: without it the outline is the same, with it sides of edges that coincide are unclear.
  void push(std::uint32_t v) {
    if (is_spike(v))
      queue_.emplace_front(v, ++turn_[v]);
    else
      queue_.emplace_back(v, ++turn_[v]);
  }

  void clip_off(std::uint32_t v) {
    const std::uint32_t a = previous_[v], c = next_[v];
    next_[a] = c;
    previous_[c] = a;
    dead_[v] = true;
    if (--alive_ > kSmall && 2 * alive_ < sorted_count_) sort_into_cells();
    push(a);
    push(c);
  }

  double turns(std::uint32_t v) const { return area(points_[previous_[v]], points_[v], points_[next_[v]]); }

  // The outline goes back at v on the way it came, or does not move.
  bool is_spike(std::uint32_t v) const {
    const Point a = points_[previous_[v]], b = points_[v], c = points_[next_[v]];
    return turns(v) == 0 && (a.x - b.x) * (c.x - b.x) + (a.y - b.y) * (c.y - b.y) >= 0;
  }

  // The triangle at v turns left, and nothing of the outline is inside it.
  bool is_ear(std::uint32_t v) {
    if (!(turns(v) > 0)) return false;
    const std::uint32_t before = previous_[v], after = next_[v];
    const Point a = points_[before], b = points_[v], c = points_[after];
    const Point low{std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y})};
    const Point high{std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y})};
    const auto hides = [&](std::uint32_t u) {
      const Point p = points_[u];
      return u != before && u != v && u != after && p.x >= low.x && p.x <= high.x && p.y >= low.y &&
             p.y <= high.y && goes_into(u, a, b, c);
    };
    if (alive_ <= kSmall) {
      visits_ += alive_;
      for (std::uint32_t u = next_[after]; u != before; u = next_[u])
        if (hides(u)) return false;
      return true;
    }
    const std::array<Point, 3> corners = {a, b, c};
    const std::uint32_t first_row = cell_of(low).second, last_row = cell_of(high).second;
    for (std::uint32_t row = first_row; row <= last_row; ++row) {
      const auto [x0, x1] = columns_of(corners, row);
      const std::uint32_t begin = cells_[row * side_ + x0], end = cells_[row * side_ + x1 + 1];
      visits_ += end - begin + 1;
      for (std::uint32_t i = begin; i < end; ++i)
        if (!dead_[sorted_[i]] && hides(sorted_[i])) return false;
    }
    return true;
  }

  // The first and the last cell of a row that the triangle may meet.
  std::pair<std::uint32_t, std::uint32_t> columns_of(const std::array<Point, 3>& corners,
                                                     std::uint32_t row) const {
    // The row in the coordinates of the points, and a little more for rounding.
    const double height = scale_.y > 0 ? 1 / scale_.y : 0;
    const double low = origin_.y + (row - 0.01) * height, high = origin_.y + (row + 1.01) * height;
    double left = std::numeric_limits<double>::infinity(), right = -left;
    for (std::size_t k = 0; k < 3; ++k) {
      const Point p = corners[k], q = corners[(k + 1) % 3];
      const auto meets_at = [&](double y) {
        const double t = q.y != p.y ? std::clamp((y - p.y) / (q.y - p.y), 0.0, 1.0) : 0;
        return p.x + t * (q.x - p.x);
      };
      for (const double x : {meets_at(low), meets_at(high)}) {
        if (std::max(p.y, q.y) < low || std::min(p.y, q.y) > high) continue;
        left = std::min(left, x);
        right = std::max(right, x);
      }
      if (p.y >= low && p.y <= high) {
        left = std::min(left, p.x);
        right = std::max(right, p.x);
      }
    }
    if (!(left <= right)) return {0, side_ - 1};
    const std::uint32_t x0 = cell_of({left, low}).first, x1 = cell_of({right, low}).first;
    return {x0 > 0 ? x0 - 1 : 0, std::min(x1 + 1, side_ - 1)};
  }

  // The outline at u, which is no corner of the triangle, has a part inside it.
  bool goes_into(std::uint32_t u, Point a, Point b, Point c) const {
    const Point p = points_[u];
    const double along_ab = area(a, b, p), along_bc = area(b, c, p), along_ca = area(c, a, p);
    if (along_ab < 0 || along_bc < 0 || along_ca < 0) return false;
    if (along_ab > 0 && along_bc > 0 && along_ca > 0) return true;
    // On the edge: one of u's own edges leads into the triangle.
    for (const std::uint32_t w : {previous_[u], next_[u]}) {
      const Point q = points_[w];
      if ((along_ab > 0 || area(a, b, q) > 0) && (along_bc > 0 || area(b, c, q) > 0) &&
          (along_ca > 0 || area(c, a, q) > 0))
        return true;
    }
    return false;
  }

  // ---- a grid of about one vertex a cell, row by row ----

  std::pair<std::uint32_t, std::uint32_t> cell_of(Point p) const {
    const auto index = [&](double v) {
      return static_cast<std::uint32_t>(std::clamp(v, 0.0, static_cast<double>(side_ - 1)));
    };
    return {index((p.x - origin_.x) * scale_.x), index((p.y - origin_.y) * scale_.y)};
  }

  void sort_into_cells() {
    sorted_count_ = alive_;
    if (alive_ <= kSmall) return;
    Point low = points_[first_alive()], high = low;
    for (std::uint32_t i = 0, v = first_; i < alive_; ++i, v = next_[v]) {
      low = {std::min(low.x, points_[v].x), std::min(low.y, points_[v].y)};
      high = {std::max(high.x, points_[v].x), std::max(high.y, points_[v].y)};
    }
    side_ = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(alive_)));
    origin_ = low;
    const auto scale = [&](double extent) { return extent > 0 ? side_ / extent : 0.0; };
    scale_ = {scale(high.x - low.x), scale(high.y - low.y)};
    cells_.assign(std::size_t{side_} * side_ + 1, 0);
    const auto cell = [&](std::uint32_t v) {
      const auto [x, y] = cell_of(points_[v]);
      return y * side_ + x;
    };
    for (std::uint32_t i = 0, v = first_; i < alive_; ++i, v = next_[v]) ++cells_[cell(v) + 1];
    std::partial_sum(cells_.begin(), cells_.end(), cells_.begin());
    sorted_.resize(alive_);
    std::vector<std::uint32_t> at(cells_.begin(), cells_.end() - 1);
    for (std::uint32_t i = 0, v = first_; i < alive_; ++i, v = next_[v]) sorted_[at[cell(v)]++] = v;
  }

  std::vector<Point> points_;
  std::vector<std::uint32_t> next_, previous_;
  std::vector<bool> dead_;
  std::vector<std::uint32_t> turn_;  // how often a vertex was put into the queue
  std::deque<std::pair<std::uint32_t, std::uint32_t>> queue_;
  std::uint32_t alive_ = 0, first_ = 0, sorted_count_ = 0, side_ = 1;
  std::uint64_t visits_ = 0;
  Point origin_, scale_;
  std::vector<std::uint32_t> cells_, sorted_;
};

// Keeps its memory from polygon to polygon.
class Cutter {
 public:
  // False: it would take too long.
  bool cut(std::span<const Vec3> positions, const Polygon& polygon, Triangles& triangles,
           std::span<Triangles* const> parallel) {
    take_corners(triangles, polygon);
    points_.clear();
    for (const std::uint32_t v : corners_) points_.push_back(positions[v]);
    if (!outline_.project(points_) || outline_.is_fan()) return true;
    if (!outline_.clip(cut_)) return false;
    replace(triangles, polygon);
    for (Triangles* list : parallel)
      if (!list->empty()) replace(*list, polygon);
    return true;
  }

 private:
  // Takes the corners of a fan, in order.
  void take_corners(const Triangles& triangles, const Polygon& polygon) {
    const auto* const fan = triangles.data() + polygon.first_triangle;
    corners_.assign({fan[0][0], fan[0][1]});
    for (std::uint32_t i = 0; i + 2 < polygon.corner_count; ++i) corners_.push_back(fan[i][2]);
  }

  void replace(Triangles& triangles, const Polygon& polygon) {
    take_corners(triangles, polygon);
    for (std::size_t i = 0; i < cut_.size(); ++i)
      triangles[polygon.first_triangle + i] = {corners_[cut_[i][0]], corners_[cut_[i][1]],
                                               corners_[cut_[i][2]]};
  }

  Outline outline_;
  std::vector<std::uint32_t> corners_;
  std::vector<Vec3> points_;
  Triangles cut_;
};

}  // namespace

Result<void> cut_polygons(std::span<const Vec3> positions, std::span<const Polygon> polygons,
                          Triangles& triangles, std::span<Triangles* const> parallel,
                          const std::string& name) {
  std::atomic<std::uint32_t> too_many = 0;  // corners
  for_ranges(polygons.size(), [&](std::size_t begin, std::size_t end) {
    Cutter cutter;
    for (std::size_t i = begin; i < end && too_many == 0; ++i)
      if (!cutter.cut(positions, polygons[i], triangles, parallel)) too_many = polygons[i].corner_count;
  });
  if (too_many == 0) return {};
  return input_error(
             fmt::format("a polygon of {} corners is too winding to be cut into triangles", too_many.load()))
      .at(name, 0)
      .with_mend("cut it into triangles where it is made");
}

}  // namespace candela::loaders
