// Scenes whose pictures are known: a matt floor under lights that no path hits, seen from above. Their files
// are in scenes/, one by one the hazards of a radius that is decided by a test.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/bench/candela_study/image_errors.h"

namespace candela::study {

struct AnalyticScene {
  std::string name;
  std::string hazard;
  std::string file;  // relative to the sources
  // Irradiance of the floor at a place of [-0.5, 0.5]^2.
  std::function<double(double x, double y)> irradiance;
  double light_paths = 1;  // per pixel, for about 20 photons in a first disc
};
const std::vector<AnalyticScene>& analytic_scenes();

// The picture of side * side pixels: the mean radiance over each, three equal channels. Edges of the light
// lie between pixels if side is a multiple of 8.
Image truth_of(const AnalyticScene& scene, std::uint32_t side);

}  // namespace candela::study
