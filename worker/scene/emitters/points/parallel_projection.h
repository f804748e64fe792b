// A parallelogram as a point with a normal sees it in perspective: projected centrally onto the plane
// normal . v = 1 parallel to the surface. Points uniform on the projection have, per solid angle, the density
// 1 / (A_p cos^3 theta), A_p being the area of the projection [Kondapaneni 2019, supplement, Sec. 2].
//
// The projection of what is near the horizon is large without end. A parallelogram with corners below a tenth
// of the greatest height over the surface is clipped at 0.4 of this height, and the rest of it has no points:
// then sampling by this alone is biased.
#pragma once

#include <array>

#include "worker/core/vec.h"

namespace candela::scene {

class ParallelProjection {
 public:
  static constexpr double kUnclipped = 0.1, kClip = 0.4;  // of the greatest height

  // corner: as seen from the reference. volume > 0: area times the distance of the plane.
  ParallelProjection(Vec3d corner, Vec3d edge_u, Vec3d edge_v, double volume, Vec3d normal);
  // A_p. Zero: nothing is above the surface.
  double area() const { return area_; }
  // True if a point of the parallelogram with this height, normal . v, may be sampled.
  bool covers(double height) const { return height > 0 && height >= min_height_; }
  // Precondition: area() > 0. The point's coordinates along the edges, in [0, 1].
  TVec2<double> sample(double u, double v) const;

 private:
  struct Corner {
    double u, v, height;
  };
  static constexpr int kMaxCorners = 5;

  void clip(const std::array<Corner, 4>& corners);
  // The projected area of triangle (0, i, i + 1) of the polygon.
  double projected_area(int i) const;

  std::array<Corner, kMaxCorners> corners_{};
  int count_ = 0;
  double volume_, min_height_ = 0, area_ = 0;
};

}  // namespace candela::scene
