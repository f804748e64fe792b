#include "worker/scene/emitters/points/parallel_projection.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "worker/core/warp.h"

namespace candela::scene {

ParallelProjection::ParallelProjection(Vec3d corner, Vec3d edge_u, Vec3d edge_v, double volume, Vec3d normal)
    : volume_(volume) {
  const double h = dot(normal, corner), hu = dot(normal, edge_u), hv = dot(normal, edge_v);
  const std::array<Corner, 4> corners = {{{0, 0, h}, {1, 0, h + hu}, {1, 1, h + hu + hv}, {0, 1, h + hv}}};
  const auto [lowest, highest] = std::minmax_element(
      corners.begin(), corners.end(), [](const Corner& a, const Corner& b) { return a.height < b.height; });
  if (!(highest->height > 0)) return;
  if (lowest->height >= kUnclipped * highest->height) {
    std::copy(corners.begin(), corners.end(), corners_.begin());
    count_ = 4;
  } else {
    min_height_ = kClip * highest->height;
    clip(corners);
  }
  for (int i = 1; i + 1 < count_; ++i) area_ += projected_area(i);
  if (!(area_ < std::numeric_limits<double>::infinity())) area_ = 0;
}

// Keeps what is not below min_height_.
void ParallelProjection::clip(const std::array<Corner, 4>& corners) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Corner &a = corners[i], &b = corners[(i + 1) % 4];
    if (a.height >= min_height_) corners_[static_cast<std::size_t>(count_++)] = a;
    if ((a.height >= min_height_) == (b.height >= min_height_)) continue;
    const double s = (min_height_ - a.height) / (b.height - a.height);
    corners_[static_cast<std::size_t>(count_++)] = {a.u + s * (b.u - a.u), a.v + s * (b.v - a.v),
                                                    min_height_};
  }
}

double ParallelProjection::projected_area(int i) const {
  // det(a, b, c) / (2 h_a h_b h_c); the determinant is twice the area along the edges times the volume.
  const Corner &a = corners_[0], &b = corners_[static_cast<std::size_t>(i)],
               &c = corners_[static_cast<std::size_t>(i) + 1];
  const double twice = std::abs((b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u));
  return twice * volume_ / (2 * a.height * b.height * c.height);
}

TVec2<double> ParallelProjection::sample(double u, double v) const {
  double x = u * area_;
  int i = 1;
  double part = projected_area(i);
  while (i + 2 < count_ && x >= part) {
    x -= part;
    part = projected_area(++i);
  }
  const Vec2 b = warp::uniform_triangle(
      {part > 0 ? static_cast<float>(std::clamp(x / part, 0.0, 1.0)) : 0.5f, static_cast<float>(v)});
  // Barycentric on the projection; on the light, each divided by its corner's height.
  const Corner* corner[] = {&corners_[0], &corners_[static_cast<std::size_t>(i)],
                            &corners_[static_cast<std::size_t>(i) + 1]};
  const double w[] = {(1 - static_cast<double>(b.x) - static_cast<double>(b.y)) / corner[0]->height,
                      static_cast<double>(b.x) / corner[1]->height,
                      static_cast<double>(b.y) / corner[2]->height};
  const double sum = w[0] + w[1] + w[2];
  const double at_u = (w[0] * corner[0]->u + w[1] * corner[1]->u + w[2] * corner[2]->u) / sum;
  const double at_v = (w[0] * corner[0]->v + w[1] * corner[1]->v + w[2] * corner[2]->v) / sum;
  return {std::clamp(at_u, 0.0, 1.0), std::clamp(at_v, 0.0, 1.0)};
}

}  // namespace candela::scene
