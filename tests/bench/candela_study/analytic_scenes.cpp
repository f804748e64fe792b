#include "tests/bench/candela_study/analytic_scenes.h"

#include <cmath>
#include <numbers>

namespace candela::study {
namespace {

// For a point light of this intensity at (x0, 0, height) above the place (x, y).
double of_point(double intensity, double x0, double height, double x, double y) {
  return intensity * height * std::pow((x - x0) * (x - x0) + y * y + height * height, -1.5);
}

// For the spot that most scenes have.
double of_spot(double x, double y) {
  return of_point(8, 0, 2, x, y);
}

// Tells if x lies in a dark row (column) of parts/dip.png, whose 48 x 48 texels lie over [-1, 1]^2.
bool in_spot(double x) {
  const int texel = static_cast<int>(std::floor(24 * (x + 1))) % 12;
  return texel == 2 || texel == 9;
}

std::string file_of(const std::string& name) {
  return "tests/bench/candela_study/scenes/" + name + ".xml";
}

}  // namespace

const std::vector<AnalyticScene>& analytic_scenes() {
  static const std::vector<AnalyticScene> scenes = {
      {"flat", "even light: every radius that shrinks is a mistake", file_of("flat"),
       [](double, double) { return 2.0; }, 2.5},
      {"gradient", "a gradient, which does not bias", file_of("gradient"),
       [](double x, double y) { return of_point(4, 0.8, 0.8, x, y); }},
      {"curvature", "a bias that grows as the squared radius", file_of("curvature"),
       [](double x, double y) { return of_point(0.4, 0, 0.4, x, y); }},
      {"edge", "a shadow's edge, 9 to 1", file_of("edge"),
       [](double x, double y) { return (x < 0 ? of_spot(x, y) : 0) + of_point(0.49, 0, 1.4, x, y); }},
      {"checker", "edges of contributions under photons of one density", file_of("checker"),
       [](double x, double y) {
         const int squares = static_cast<int>(std::floor(4 * x)) + static_cast<int>(std::floor(4 * y));
         return of_spot(x, y) * (squares % 2 == 0 ? 0.2 : 1);
       }},
      {"two-lights", "an edge of photon density in nearly even light", file_of("two-lights"), of_spot},
      {"dip", "dark spots of an eighth of the first radius", file_of("dip"),
       [](double x, double y) { return of_spot(x, y) * (in_spot(x) && in_spot(y) ? 0.2 : 1); }},
  };
  return scenes;
}

Image truth_of(const AnalyticScene& scene, std::uint32_t side) {
  constexpr int kPoints = 24;  // of a pixel's side
  Image image;
  for (std::uint32_t row = 0; row < side; ++row)
    for (std::uint32_t column = 0; column < side; ++column) {
      double sum = 0;
      for (int i = 0; i < kPoints; ++i)
        for (int j = 0; j < kPoints; ++j)
          sum += scene.irradiance((column + (i + 0.5) / kPoints) / side - 0.5,
                                  0.5 - (row + (j + 0.5) / kPoints) / side);
      const double radiance = sum / (kPoints * kPoints) * 0.5 / std::numbers::pi;
      for (int channel = 0; channel < 3; ++channel) image.push_back(static_cast<float>(radiance));
    }
  return image;
}

}  // namespace candela::study
