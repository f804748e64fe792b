// A lamp in the shape of a rectangle over a point that reflects evenly, and three ways of sampling it
// [Kondapaneni 2019, supplement, Eq. S1]: uniformly in solid angle (spherical) [Urena 2013], uniformly in
// area, and uniformly on its image in the tangent plane of the point (parallel).
//
// The point is the origin, the lamp [x0, x1] x [y0, y1] at height z > 0 along its own normal; L = 1.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "tests/bench/candela_study/mis_case.h"

namespace candela::study {

struct LampPlace {
  double x, y, z;
};

class LampOverPoint {
 public:
  enum Technique : std::uint8_t { spherical, area, parallel };
  static constexpr std::array<const char*, 3> kNames = {"spherical", "area", "parallel"};
  // The parallel technique leaves out what is lower over the horizon than `clip` times the highest corner.
  LampOverPoint(std::string name, std::array<double, 4> rectangle, double z, LampPlace normal,
                double clip = 0.05);

  const std::string& name() const { return name_; }
  double solid_angle() const { return solid_angle_; }
  double parallel_area() const { return parallel_area_; }
  double irradiance() const;  // Lambert's formula

  // Place on the lamp of two random numbers.
  std::array<double, 2> sample(Technique technique, double u, double v) const;
  // The cosine, and the densities per solid angle of all techniques; weight: solid angle of a unit of area.
  MisPoint at(double x, double y) const;
  // Quadrature over the lamp by solid angle, cut at the horizon and at the clip.
  std::vector<MisPoint> points() const;
  double coordinate(std::size_t axis, double u) const;  // [0, 1] to the lamp's extent

 private:
  struct Triangle {
    std::array<LampPlace, 3> corners;
    double area;  // of its image
  };
  double x_from_share(double share) const;

  std::string name_;
  double x0_, x1_, y0_, y1_, z_;
  LampPlace normal_;
  std::vector<LampPlace> corners_, lit_, kept_;  // lit: above the horizon; kept: by the parallel technique
  bool whole_;                                   // it keeps all of the lamp
  double clip_height_ = 0, solid_angle_ = 0, parallel_area_ = 0;
  std::vector<Triangle> triangles_;  // of kept_
};

std::vector<LampOverPoint> lamps_over_points();  // R1 to R6
inline const std::vector<std::vector<LampOverPoint::Technique>> kLampTechniqueSets = {
    {LampOverPoint::spherical, LampOverPoint::area},
    {LampOverPoint::spherical, LampOverPoint::parallel},
    {LampOverPoint::spherical, LampOverPoint::area, LampOverPoint::parallel}};
MisCase lamp_case(const LampOverPoint& lamp, const std::vector<LampOverPoint::Technique>& techniques);

}  // namespace candela::study
