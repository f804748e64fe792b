// Guards: the importance of eight surfaces at a time is that of each of them, bit by bit, also at its center,
// inside of it, behind it and without a front.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "common/rng/stream.h"
#include "worker/core/math.h"
#include "worker/scene/emitters/choice/surface_lanes.h"
#include "worker/scene/emitters/surface_extent.h"

namespace candela::scene {
namespace {

TEST(SurfaceLanes, HaveTheBitsOfEachSurface) {
  rng::Stream stream(rng::key(47, 6));
  const auto uniform = [&] { return static_cast<float>(stream.next_double()); };
  const auto vector = [&] { return Vec3(2 * uniform() - 1, 2 * uniform() - 1, 2 * uniform() - 1); };
  std::size_t compared = 0, positive = 0;
  for (int round = 0; round < 400; ++round) {
    const std::size_t count = 1 + stream.next_u32() % 19;
    SurfaceLanes lanes;
    std::vector<SurfaceLane> surfaces(count);
    for (std::size_t i = 0; i < count; ++i) {
      SurfaceLane& s = surfaces[i];
      s.extent.center = vector();
      s.extent.radius = round % 5 == 0 ? 0.0f : uniform() * uniform();
      s.extent.axis = normalize(vector());
      s.cone = i % 3 != 0;
      const float spread = i % 4 == 0 ? math::kPi : math::kPi * uniform() * uniform();
      s.extent.cos_spread = std::cos(spread);
      s.extent.sin_spread = std::sin(spread);
      s.strength = std::exp(40 * (uniform() - 0.5f));
      if (i % 3 == 1) {
        s.corner = s.extent.center;
        s.normal = s.extent.axis;
      }
      s.ask = i % 7 == 3;
      lanes.add(static_cast<std::uint32_t>(i), s);
    }
    for (int look = 0; look < 20; ++look) {
      const Vec3 p = look == 0 ? surfaces[0].extent.center : vector() * (look % 4 == 1 ? 0.1f : 3.0f);
      const Vec3 front = look % 3 == 0 ? Vec3() : normalize(vector());
      std::vector<float> found(count, -1.0f);
      lanes.importances(p, front, found.data());
      for (std::size_t i = 0; i < count; ++i) {
        const SurfaceLane& s = surfaces[i];
        float expected = s.cone ? s.extent.importance<true>(s.strength, p, front)
                                : s.extent.importance<false>(s.strength, p, front);
        if (!(s.normal.x == 0 && s.normal.y == 0 && s.normal.z == 0) && !(dot(p - s.corner, s.normal) > 0))
          expected = 0;
        ASSERT_EQ(std::bit_cast<std::uint32_t>(found[i]), std::bit_cast<std::uint32_t>(expected))
            << "round " << round << ", look " << look << ", surface " << i << ": " << found[i] << " for "
            << expected;
        ++compared;
        positive += expected > 0 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(positive, compared / 4);
  EXPECT_LT(positive, compared);
}

}  // namespace
}  // namespace candela::scene
