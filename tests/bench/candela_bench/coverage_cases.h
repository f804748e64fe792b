// The cases of `candela-bench coverage`: scenes, and the halves of images after 4, 8, 16 ... samples a pixel,
// which are rendered once and kept.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/stats/movement.h"
#include "tests/half_images.h"

namespace candela::bench {

struct CoverageScene {
  std::string name;
  std::filesystem::path file;
  // The method was chosen without a look at it, but for the integrators `looked_at`.
  bool held_out = false;
  std::vector<std::string> looked_at = {};
  // Integrators whose expectation is the whole image, of merging ones in the limit of small radii.
  std::vector<std::string> integrators;
  // Every value of the image; 0: a reference is rendered.
  double exact = 0;
  // Integrator of the reference, and its samples per pixel.
  std::string reference = "bdpt";
  std::uint64_t reference_spp = 8192;
};
bool held_out(const CoverageScene& scene, const std::string& integrator);
// The scenes whose files are there.
std::vector<CoverageScene> coverage_scenes();

// The image after `spp` samples a pixel, with those before it.
struct CoveragePoint {
  std::uint64_t spp = 0;
  double alpha = 1, expected_bias = 0;  // stats::ErrorContext's
  bool connects = false;
  stats::HalfImages halves;
  stats::Movement::Bias measured;  // empty: the bias is not
};

// The points of one job, in order. Kept in `folder`, and read from there if they are. A job of chains is one
// of its own for each point, as chains and segments follow from a job's length.
Result<std::vector<CoveragePoint>> coverage_points(const std::filesystem::path& folder,
                                                   const CoverageScene& scene, const std::string& integrator,
                                                   std::uint64_t seed, std::uint32_t side,
                                                   const std::vector<std::uint64_t>& spp);

}  // namespace candela::bench
