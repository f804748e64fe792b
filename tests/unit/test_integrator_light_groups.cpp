// Groups of lights: which emitters are in them, the choice in a group, and settings that have no groups.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "tests/unit/chi_squared.h"
#include "tests/unit/renderer_fixture.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/emitters/light_groups.h"

namespace candela {
namespace {

using scene::LightPartition;
using scene::LightTechnique;

const std::string kGround =
    R"(<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform></shape>)";
const std::string kThreeWithAPlace =
    R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate x="1" y="0" z="2"/></transform><emitter type="area"/></shape>
       <shape type="sphere"><point name="center" x="-1" y="0" z="1"/><float name="radius" value="0.3"/><emitter type="area"/></shape>
       <emitter type="point"><point name="position" x="0" y="1" z="1"/></emitter>)";
const std::string kSkiesAndSun =
    R"(<emitter type="constant"><rgb name="radiance" value="0.2"/></emitter>
       <emitter type="directional"><vector name="direction" x="0.1" y="0" z="-1"/></emitter>
       <emitter type="sky"/>)";

std::unique_ptr<scene::Scene> built(const std::string& xml) {
  auto scene = test::build_scene(kGround + xml, {}, "<sensor type=\"perspective\"/>");
  if (!scene.ok()) throw std::runtime_error(scene.error().to_string());
  return std::move(*scene);
}
std::string many_points() {
  std::string xml;
  for (int i = 0; i < 100; ++i)
    xml += "<emitter type=\"point\"><point name=\"position\" x=\"" + std::to_string(0.37 * (i % 10) - 1.8) +
           "\" y=\"" + std::to_string(0.53 * (i / 10) - 2.5) + "\" z=\"1\"/></emitter>";
  return xml;
}

// Claim: groups are those that the plan counts, and environments are in one group.
TEST(IntegratorLightGroups, AreThoseOfTheFeatures) {
  struct Case {
    std::string xml;
    LightPartition partition;
  };
  const Case cases[] = {{kThreeWithAPlace + kSkiesAndSun, LightPartition::infinite},
                        {kThreeWithAPlace + kSkiesAndSun, LightPartition::each},
                        {kThreeWithAPlace, LightPartition::each}};
  for (const Case& c : cases) {
    const auto scene = built(c.xml);
    const scene::LightGroups groups(scene->lights(), c.partition);
    EXPECT_EQ(groups.size(), scene::light_group_count(c.partition, scene->features()));
    std::vector<int> members(groups.size());
    for (std::uint32_t i = 0; i < scene->lights().size(); ++i) {
      ++members.at(groups.of(i));
      if (scene->lights().is_environment(i)) {
        EXPECT_EQ(groups.of(i), groups.of_environment());
      }
      if (c.partition == LightPartition::infinite) {
        EXPECT_EQ(groups.of(i), scene->lights().infinite(i) ? 1U : 0U);
      }
    }
    for (const int count : members) EXPECT_GT(count, 0);
  }
  const auto scene = built(kThreeWithAPlace);
  EXPECT_EQ(scene::light_group_count(LightPartition::infinite, scene->features()), 1U);
}

// Claim: the choice in a group has the probabilities of the technique among all, normalized; draws follow
// them, and densities of points agree. Few lights and a tree of lights. 12 chi-squared tests at 1e-6: a false
// alarm over seeds with 1.2e-5.
TEST(IntegratorLightGroups, ChoiceIsTheTechniquesNormalized) {
  for (const std::string& xml : {kThreeWithAPlace + kSkiesAndSun, many_points() + kSkiesAndSun}) {
    const auto built_scene = built(xml);
    const scene::Lights& lights = built_scene->lights();
    const scene::LightGroups groups(lights, LightPartition::infinite);
    scene::SurfaceHit here;
    here.p = {0.2f, 0.1f, 0};
    here.ng = {0, 0, 1};
    const Vec3 front = {0, 0, 1};
    for (const LightTechnique technique : scene::kLightTechniques) {
      for (std::size_t g = 0; g < groups.size(); ++g) {
        std::vector<double> prob(lights.size()), all(lights.size());
        for (std::uint32_t i = 0; i < lights.size(); ++i) {
          if (groups.of(i) != g) continue;
          prob[i] = static_cast<double>(lights.prob(here.p, front, i, technique, groups[g]));
          all[i] = static_cast<double>(lights.prob(here.p, front, i, technique));
        }
        const double sum = std::accumulate(all.begin(), all.end(), 0.0);
        EXPECT_NEAR(std::accumulate(prob.begin(), prob.end(), 0.0), 1, 1e-5);
        for (std::size_t i = 0; i < prob.size(); ++i) EXPECT_NEAR(prob[i], all[i] / sum, 1e-5) << i;

        constexpr int kDraws = 10000;
        std::vector<double> chosen(prob.size());
        samplers::Sampler sampler(samplers::SamplerKind::independent, 3);
        for (int k = 0; k < kDraws; ++k) {
          sampler.start(0, static_cast<std::uint64_t>(k), 0, 0);
          const float u_select = sampler.draw_1d(0, false);
          scene::DirectSample light;
          const auto outcome = lights.sample(here, front, u_select, sampler.draw_2d(1, false), light,
                                             technique, groups[g], scene::PointSampler::own);
          if (outcome == scene::DirectOutcome::failed) continue;
          ASSERT_LT(light.emitter, prob.size());
          ASSERT_EQ(groups.of(light.emitter), g);
          ++chosen[light.emitter];
          if (!light.infinite || light.delta) continue;
          EXPECT_NEAR(static_cast<double>(light.pdf_solid_angle),
                      static_cast<double>(
                          lights.pdf_environment_solid_angle(here, front, light.wi, technique, groups[g])),
                      1e-5 * static_cast<double>(light.pdf_solid_angle));
        }
        // A point that an emitter fails to give is not counted: spheres and skies give one here.
        std::vector<double> expected(prob.size());
        for (std::size_t i = 0; i < prob.size(); ++i) expected[i] = prob[i] * kDraws;
        EXPECT_GT(test::chi_squared_p(chosen, expected), 1e-6) << g;
      }
    }
  }
}

// Claim: a trained selection, which has all lights in one group, is refused by name.
TEST(IntegratorLightGroups, RefuseTrainedSelection) {
  for (const char* groups : {"infinite", "each"}) {
    const auto settings = render::complete_integrator_settings(
        "optimis", {}, {{"light_groups", groups}, {"selection", "trained"}});
    ASSERT_FALSE(settings.ok()) << groups;
    EXPECT_EQ(settings.error().field, "selection") << settings.error().to_string();
  }
}

}  // namespace
}  // namespace candela
