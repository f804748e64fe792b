// Integrals of a density and three values over the sphere of directions, split into bins of about equal
// probability: the expected counts of a chi-squared test and the integrals behind the energy balance.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "worker/core/vec.h"

namespace candela::test {

// Polar coordinates in which each hemisphere is a rectangle and nothing near its pole is singular:
// t = sqrt(1 - |cos theta|) in [0, 1], phi in [-pi, pi]; d(solid angle) = 2 t dt dphi.
struct SpherePoint {
  bool below;
  double t, phi;
};
SpherePoint to_point(Vec3 w);
Vec3 to_direction(const SpherePoint& p);

// density, and three more integrands.
using Integrands = std::array<double, 4>;

class SphereBins {
 public:
  // Bins such that each holds about as many of the directions given, `bins` in all. The boxes that
  // integrate() starts from are finer: they hold at most per_box directions, so that narrow lobes are met.
  SphereBins(const std::vector<Vec3>& directions, int bins, int per_box);

  std::size_t count() const { return bin_count_; }
  std::size_t bin_of(Vec3 w) const;

  // One integral per bin, by adaptive cubature: boxes are cut in four, the worst first, until
  // the sum of all differences between a box and its quarters is below `error` in the density and 5 times
  // that in the others, no direction given lies in a peak that was missed, or `most_boxes` have been looked
  // at. error_left: the sum reached (of the density).
  std::vector<Integrands> integrate(const std::function<Integrands(Vec3)>& f, double error, int most_boxes,
                                    double& error_left) const;

 private:
  struct Box {
    bool below;
    double t0, t1, phi0, phi1;
  };
  struct Node {
    Box box;
    int axis = -1;  // 0: t, 1: phi; -1: a leaf
    double split = 0;
    std::size_t low = 0, high = 0;  // children
    std::size_t bin = 0;            // of leaves; and the directions there
    std::vector<SpherePoint> points = {};
  };
  std::size_t build(const Box& box, std::vector<SpherePoint> points, std::size_t bin, int depth);

  std::size_t per_bin_, per_box_;
  std::vector<Node> nodes_;
  std::array<std::size_t, 2> roots_{};
  std::size_t bin_count_ = 0;
};

}  // namespace candela::test
