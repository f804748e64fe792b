// Layers by light path expressions of mlt, whose states are whole paths. Seeds are fixed: nothing here is
// left to chance.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/epoch_run.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/layered_room.h"

namespace candela::statistical {
namespace {

std::vector<std::int64_t> sums_of_chains(const TestScene& scene, std::uint64_t rounds, unsigned threads) {
  return render_chains({scene, rounds, threads}, scene.settings.seed).sums;
}

std::vector<std::int64_t> sums_of_bdpt(const TestScene& scene) {
  const auto renderer = make_renderer(scene);
  const auto pilot = renderer->pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  const auto job = test::render_job(*renderer, *pilot, 64, {});
  if (!job.ok()) throw std::runtime_error(job.error().to_string());
  return job->halves[0].sums;
}

// Claim: with layers that are a partition the image is what it is without them, and is their sum, all to the
// last bit of the film, whatever the threads.
TEST(MltLayers, AddUpToTheImage) {
  const Layers layers = {{"seen", "LE"},
                         {"diffuse", "L[DGSV]*DE"},
                         {"glossy", "L[DGSV]*GE"},
                         {"specular", "L[DGSV]*SE"},
                         {"volume", "L[DGSV]*VE"}};
  const auto plain = sums_of_chains(layered_room("mlt", {}, {}), 8, 1);
  const auto all = sums_of_chains(layered_room("mlt", {}, layers, true), 8, 1);
  EXPECT_TRUE(all == sums_of_chains(layered_room("mlt", {}, layers, true), 8, 3)) << "threads leave a trace";
  // The chains' part and that of independent samples, then the layers of each.
  ASSERT_EQ(plain.size(), 2 * kRoomValues);
  ASSERT_EQ(all.size(), kRoomValues * 2 * (1 + layers.size()));
  ASSERT_TRUE(std::equal(plain.begin(), plain.end(), all.begin()));
  std::size_t lit = 0;
  for (std::size_t part = 0; part < 2; ++part)
    for (std::size_t i = 0; i < kRoomValues; ++i) {
      std::int64_t sum = 0;
      for (std::size_t e = 0; e < layers.size(); ++e) {
        const std::int64_t value = all[(2 + part * layers.size() + e) * kRoomValues + i];
        sum += value;
        lit += part == 0 && value != 0;
      }
      ASSERT_EQ(sum, all[part * kRoomValues + i]) << "value " << i << " of part " << part;
    }
  EXPECT_GT(lit, 100u);
}

// Claim: whole paths have the labels that walks give them: each layer's share of the light is that of bdpt,
// by lamp, by lobe, and by object.
TEST(MltLayers, HaveTheSharesOfBdpt) {
  // Chains have paths of two scattering vertices and more.
  const Layers layers = {{"all", "L[DGSV][DGSV]+E"},      {"bulb", "L{bulb}[DGSV][DGSV]+E"},
                         {"sky", "L{sky}[DGSV][DGSV]+E"}, {"diffuse", "L[DGSV]+DE"},
                         {"lobe", "LD{floor}[DGSV]+E"},   {"ball", "L[DGSV]+G{ball}E"}};
  const auto shares = [&](const std::vector<std::int64_t>& sums, std::size_t first) {
    std::vector<double> light(layers.size());
    for (std::size_t e = 0; e < layers.size(); ++e)
      for (std::size_t i = 0; i < kRoomValues; ++i)
        light[e] += static_cast<double>(sums[(first + e) * kRoomValues + i]);
    for (std::size_t e = layers.size(); e-- > 0;) light[e] /= light[0];
    return light;
  };
  // The sums are those of chains alone, which leave to large steps what these find, most where the importance
  // of the film is low.
  const SettingsMap few_large = {{"large_step", "0.001"}};
  const auto expected = shares(sums_of_bdpt(layered_room("bdpt", {}, layers)), 1),
             found = shares(sums_of_chains(layered_room("mlt", few_large, layers), 3200, 1), 2);
  for (std::size_t e = 1; e < layers.size(); ++e) {
    EXPECT_NEAR(found[e], expected[e], 0.05) << layers[e].name;
    EXPECT_GT(expected[e], 0.08) << layers[e].name;
    EXPECT_LT(expected[e], 0.92) << layers[e].name;
  }
}

}  // namespace
}  // namespace candela::statistical
