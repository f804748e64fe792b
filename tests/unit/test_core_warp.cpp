// Warps: sampled distributions against their densities by chi-squared, and points that must not occur.
// Every p-value is compared with 0.01 / (number of tests here), so the family's false-alarm rate is 1 %;
// seeds are fixed.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "chi_squared.h"
#include "common/rng/stream.h"
#include "worker/core/warp.h"

namespace candela {
namespace {

constexpr double kAlarm = 0.01 / 8;
constexpr int kSamples = 200000;
constexpr int kBins = 16;

// Coordinates of equal measure, from the warp's output: uniform on the square if the warp is right.
double p_of_uniform(const std::function<Vec2(Vec2)>& coordinates, std::uint64_t seed) {
  std::vector<double> observed(kBins * kBins);
  rng::Stream stream(rng::key(seed));
  for (int i = 0; i < kSamples; ++i) {
    const float ux = stream.next_float();
    const float uy = stream.next_float();
    const Vec2 c = coordinates({ux, uy});
    const int x = std::clamp(static_cast<int>(c.x * kBins), 0, kBins - 1);
    const int y = std::clamp(static_cast<int>(c.y * kBins), 0, kBins - 1);
    ++observed[static_cast<std::size_t>(y * kBins + x)];
  }
  return test::chi_squared_p(
      observed, std::vector<double>(kBins * kBins, static_cast<double>(kSamples) / (kBins * kBins)));
}
float turn(float y, float x) {
  return std::atan2(y, x) / (2 * math::kPi) + 0.5f;
}

// Claim: each warp has the density it states.
TEST(Warp, DistributionsAreUniformInTheirOwnMeasure) {
  EXPECT_GT(p_of_uniform(
                [](Vec2 u) {
                  const Vec2 d = warp::concentric_disk(u);
                  return Vec2{d.x * d.x + d.y * d.y, turn(d.y, d.x)};
                },
                1),
            kAlarm);
  EXPECT_GT(p_of_uniform(
                [](Vec2 u) {
                  const Vec3 d = warp::cosine_hemisphere(u);
                  return Vec2{1 - d.z * d.z, turn(d.y, d.x)};
                },
                2),
            kAlarm);
  EXPECT_GT(p_of_uniform(
                [](Vec2 u) {
                  const Vec3 d = warp::uniform_sphere(u);
                  return Vec2{(d.z + 1) / 2, turn(d.y, d.x)};
                },
                3),
            kAlarm);
  for (const float h : {1e-10f, 1e-4f, 0.5f, 2.0f}) {
    EXPECT_GT(p_of_uniform(
                  [h](Vec2 u) {
                    const Vec3 d = warp::uniform_cone(u, h);
                    const double r2 = static_cast<double>(d.x) * d.x + static_cast<double>(d.y) * d.y;
                    // 1 - cos from the sine: the cosine of a narrow cone has no digits.
                    const double height = d.z > 0 ? r2 / (1 + std::sqrt(std::max(0.0, 1 - r2)))
                                                  : 1.0 - static_cast<double>(d.z);
                    return Vec2{static_cast<float>(height / static_cast<double>(h)), turn(d.y, d.x)};
                  },
                  4),
              kAlarm)
        << h;
  }
  EXPECT_GT(p_of_uniform(
                [](Vec2 u) {
                  const Vec2 b = warp::uniform_triangle(u);
                  // b1 + b2 <= 1 has equal areas in ((b1 + b2)^2, b2 / (b1 + b2)).
                  const float sum = b.x + b.y;
                  return Vec2{sum * sum, sum > 0 ? b.y / sum : 0};
                },
                5),
            kAlarm);
}

// Claim: no warp leaves its domain or gives a direction along the surface, at the corners of the unit square
// least of all.
TEST(Warp, StaysInsideAtTheCorners) {
  const float last = 1 - 0x1p-24f;
  for (const float x : {0.0f, 0x1p-24f, 0.5f, last}) {
    for (const float y : {0.0f, 0x1p-24f, 0.5f, last}) {
      const Vec3 c = warp::cosine_hemisphere({x, y});
      EXPECT_GT(c.z, 0);
      EXPECT_NEAR(length(c), 1, 1e-6f);
      EXPECT_GT(warp::pdf_cosine_hemisphere_solid_angle(c.z), 0);
      EXPECT_NEAR(length(warp::uniform_sphere({x, y})), 1, 1e-6f);
      const Vec2 t = warp::uniform_triangle({x, y});
      EXPECT_GE(t.x, 0);
      EXPECT_GE(t.y, 0);
      EXPECT_LE(t.x + t.y, 1);
    }
  }
}

}  // namespace
}  // namespace candela
