// Claims: kernels on a line integrate to one, and effective_length is 1 / int K^2; the closest points of two
// lines, and of a line and a point, are those of which none are closer, far from the origin and nearly
// parallel too.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "common/rng/stream.h"
#include "tests/unit/scene_fixture.h"
#include "worker/transport/beams.h"
#include "worker/transport/kernels.h"

namespace candela::transport {
namespace {

TEST(Beams, LineKernelsIntegrateToOne) {
  for (const Kernel kernel : {Kernel::constant, Kernel::epanechnikov, Kernel::perlin})
    for (const float radius : {1e-3f, 0.25f, 40.0f}) {
      const LineKernel line(kernel, radius);
      constexpr int kSteps = 20000;
      const double r = static_cast<double>(radius), step = 2 * r / kSteps;
      double mass = 0, square = 0;
      for (int i = 0; i < kSteps; ++i) {
        const double x = -r + (i + 0.5) * step;
        const double k = static_cast<double>(line.value(static_cast<float>(x * x)));
        mass += k * step;
        square += k * k * step;
      }
      EXPECT_NEAR(mass, 1, 1e-6) << static_cast<int>(kernel) << ' ' << radius;
      EXPECT_NEAR(square * effective_length(kernel, r), 1, 1e-6) << static_cast<int>(kernel) << ' ' << radius;
    }
}

// The squared distance of o_a + s a and o_b + t b.
double squared_distance(Vec3 o_a, Vec3 a, double s, Vec3 o_b, Vec3 b, double t) {
  return length_squared(Vec3d(o_a) + Vec3d(a) * s - Vec3d(o_b) - Vec3d(b) * t);
}

TEST(Beams, NoPointsOfTwoLinesAreCloser) {
  rng::Stream stream(rng::key(3, 1));
  for (int i = 0; i < 2000; ++i) {
    const float far = i % 2 == 0 ? 0.0f : 100.0f;
    const Vec3 o_a = test::uniform_direction(stream) * 5 + Vec3{far, far, far},
               o_b = test::uniform_direction(stream) * 5 + Vec3{far, far, far};
    const Vec3 a = test::uniform_direction(stream), b = test::uniform_direction(stream);
    const Approach found = closest_approach(o_a, a, o_b, b);
    EXPECT_NEAR(found.sine, std::sqrt(std::max(0.0, 1 - std::pow(dot(Vec3d(a), Vec3d(b)), 2))), 1e-6);
    if (found.sine < 0.01) continue;
    const double least = squared_distance(o_a, a, found.along_a, o_b, b, found.along_b);
    EXPECT_NEAR(std::sqrt(least), found.distance, 1e-6 * (1 + found.distance) / found.sine);
    for (const double step : {-0.01, 0.01}) {
      EXPECT_LT(least, squared_distance(o_a, a, found.along_a + step, o_b, b, found.along_b));
      EXPECT_LT(least, squared_distance(o_a, a, found.along_a, o_b, b, found.along_b + step));
      EXPECT_LT(least, squared_distance(o_a, a, found.along_a + step, o_b, b, found.along_b + step));
    }
  }
}

// Two lines that cross at s = t = 10 at a small angle, whose directions are rounded to floats.
TEST(Beams, SmallAnglesKeepTheirDigits) {
  for (const double angle : {1e-1, 1e-2, 1e-3, 1e-4}) {
    const Vec3 a{1, 0, 0}, b(Vec3d{std::cos(angle), std::sin(angle), 0});
    const Vec3d crossing = Vec3d(a) * 10.0;
    const Vec3 o_b(crossing - Vec3d(b) * 10.0);
    const Approach found = closest_approach({0, 0, 0}, a, o_b, b);
    EXPECT_NEAR(found.sine / std::sin(angle), 1, 1e-6) << angle;
    // The origin is rounded by some 1e-7 of itself, which the angle magnifies.
    EXPECT_NEAR(found.along_b, 10, 1e-6 / angle) << angle;
    EXPECT_LT(found.distance, 1e-6) << angle;
  }
  EXPECT_EQ(closest_approach({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}).sine, 0) << "parallel";
}

// Claim: the early rejection loses no pair that the distance keeps, least of all at the distance itself, and
// spares nearly all that it rejects.
TEST(Beams, EarlyRejectionLosesNoPair) {
  rng::Stream stream(rng::key(3, 4));
  int kept = 0, closer = 0;
  for (int i = 0; i < 20000; ++i) {
    const float far = i % 2 == 0 ? 0.0f : 1000.0f;
    const Vec3 o_a = test::uniform_direction(stream) * 5 + Vec3{far, far, far},
               o_b = test::uniform_direction(stream) * 5 + Vec3{far, far, far};
    const Vec3 a = test::uniform_direction(stream);
    const Vec3 b = i % 4 < 2 ? test::uniform_direction(stream)
                             : normalize(a + test::uniform_direction(stream) * 1e-4f);  // nearly parallel
    const LinePair lines(o_a, a, o_b, b);
    const Approach found = lines.approach();
    if (!(found.sine > 0)) continue;
    EXPECT_TRUE(lines.may_be_within(std::nextafter(found.distance, 1e9))) << i;
    EXPECT_FALSE(lines.may_be_within(found.distance * (1 - 1e-9))) << i;
    kept += lines.may_be_within(1) ? 1 : 0;
    closer += found.distance < 1 ? 1 : 0;
  }
  EXPECT_EQ(kept, closer);
  EXPECT_GT(closer, 1000);
}

TEST(Beams, ProjectionIsTheNearestPoint) {
  rng::Stream stream(rng::key(3, 2));
  for (int i = 0; i < 1000; ++i) {
    const Vec3 o = test::uniform_direction(stream) * 3, d = test::uniform_direction(stream),
               p = test::uniform_direction(stream) * 7;
    const Projection found = project(o, d, p);
    const auto at = [&](double t) { return length_squared(Vec3d(o) + Vec3d(d) * t - Vec3d(p)); };
    EXPECT_NEAR(at(found.along), found.distance_squared, 1e-6 * (1 + found.distance_squared));
    EXPECT_LT(at(found.along), at(found.along + 0.01));
    EXPECT_LT(at(found.along), at(found.along - 0.01));
  }
}

}  // namespace
}  // namespace candela::transport
