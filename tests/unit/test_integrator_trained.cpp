// Light selection with weights, as trained selection of optimis chooses, and what it refuses.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/renderer_fixture.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/emitters/lights.h"

namespace candela {
namespace {

const std::string kThreeLampsAndSky =
    R"(<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform></shape>
       <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate x="1" y="0" z="2"/></transform><emitter type="area"/></shape>
       <shape type="sphere"><point name="center" x="-1" y="0" z="1"/><float name="radius" value="0.3"/><emitter type="area"/></shape>
       <emitter type="point"><point name="position" x="0" y="1" z="1"/></emitter>
       <emitter type="constant"><rgb name="radiance" value="0.2"/></emitter>)";

// Draws choose as `prob` says, within 5 standard errors and `floor` for each emitter; densities of the
// environment's points agree with the choice.
void expect_drawn(const scene::Lights& lights, const scene::SurfaceHit& here, Vec3 front,
                  const scene::ChoiceWeights& weights, const std::vector<double>& prob, double floor) {
  constexpr int kDraws = 40000;
  std::vector<double> chosen(prob.size());
  samplers::Sampler sampler(samplers::SamplerKind::independent, 3);
  for (int k = 0; k < kDraws; ++k) {
    sampler.start(0, static_cast<std::uint64_t>(k), 0, 0);
    const float u_select = sampler.draw_1d(0, false);
    const Vec2 u = sampler.draw_2d(1, false);
    scene::DirectSample light;
    const auto outcome = lights.sample(here, front, u_select, u, light, weights, scene::PointSampler::own);
    ASSERT_NE(outcome, scene::DirectOutcome::failed);
    ASSERT_LT(light.emitter, prob.size());
    ++chosen[light.emitter];
    if (!light.infinite || light.delta) continue;
    EXPECT_NEAR(static_cast<double>(light.pdf_solid_angle),
                static_cast<double>(lights.pdf_environment_solid_angle(here, front, light.wi, weights)),
                1e-5 * static_cast<double>(light.pdf_solid_angle));
  }
  for (std::size_t i = 0; i < prob.size(); ++i)
    EXPECT_NEAR(chosen[i] / kDraws, prob[i], 5 * std::sqrt(prob[i] * (1 - prob[i]) / kDraws) + floor) << i;
}

// Claim: the choice has the probabilities that it tells, which are those of `contribution` times the weights,
// and densities of points agree with them. 5 standard errors for each emitter.
TEST(IntegratorTrained, ChoosesByTheProbabilitiesItTells) {
  auto built = test::build_scene(kThreeLampsAndSky, {}, "<sensor type=\"perspective\"/>");
  ASSERT_TRUE(built.ok()) << built.error().to_string();
  const scene::Lights& lights = (*built)->lights();
  const std::vector<std::uint8_t> by_emitter = {16, 255, 100, 37};
  const scene::ChoiceWeights weights{by_emitter};
  ASSERT_EQ(lights.size(), by_emitter.size());
  scene::SurfaceHit here;
  here.p = {0.2f, 0.1f, 0};
  here.ng = {0, 0, 1};
  const Vec3 front = {0, 0, 1};
  double sum = 0, share = 0;
  std::vector<double> prob(by_emitter.size());
  for (std::uint32_t i = 0; i < by_emitter.size(); ++i) {
    prob[i] = static_cast<double>(lights.prob(here.p, front, i, weights));
    sum += prob[i];
    share += static_cast<double>(lights.prob(here.p, front, i)) * by_emitter[i];
  }
  EXPECT_NEAR(sum, 1, 1e-6);
  for (std::uint32_t i = 0; i < by_emitter.size(); ++i)
    EXPECT_NEAR(prob[i], static_cast<double>(lights.prob(here.p, front, i)) * by_emitter[i] / share, 1e-6);
  expect_drawn(lights, here, front, weights, prob, 1e-9);
}

// Claim: among more lights than have weights of their own, all emitters of a group share one; the choice has
// the probabilities that it tells, which are those of `contribution` if all weights are the same, and more
// than zero wherever those are. 150 point lights, a distant one and a sky; 5 standard errors for each
// emitter.
TEST(IntegratorTrained, ChoosesAmongManyByGroups) {
  std::string xml =
      R"(<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform></shape>
      <emitter type="directional"><vector name="direction" x="0.1" y="0" z="-1"/></emitter>
      <emitter type="constant"><rgb name="radiance" value="0.2"/></emitter>)";
  for (int i = 0; i < 150; ++i)
    xml += "<emitter type=\"point\"><point name=\"position\" x=\"" + std::to_string(0.37 * (i % 15) - 2.5) +
           "\" y=\"" + std::to_string(0.53 * (i / 15) - 2.5) + "\" z=\"" +
           std::to_string(0.5 + 0.1 * (i % 7)) + "\"/></emitter>";
  auto built = test::build_scene(xml, {}, "<sensor type=\"perspective\"/>");
  ASSERT_TRUE(built.ok()) << built.error().to_string();
  const scene::Lights& lights = (*built)->lights();
  ASSERT_EQ(lights.size(), 152U);
  scene::SurfaceHit here;
  here.p = {0.2f, 0.1f, 0};
  here.ng = {0, 0, 1};
  const Vec3 front = {0, 0, 1};
  std::vector<int> members(scene::Lights::kMaxGroups);
  for (std::uint32_t i = 0; i < lights.size(); ++i) ++members.at(lights.group(i));
  EXPECT_EQ(members[0], 1) << "lights that are infinitely far away are groups of their own";
  EXPECT_EQ(members[1], 1);
  for (const int count : members) EXPECT_TRUE(count > 0 && count < 20) << count;

  std::vector<std::uint8_t> by_group(scene::Lights::kMaxGroups, 100);
  scene::Lights::NodeWeights room;
  const scene::ChoiceWeights same = lights.weights(by_group, room);
  for (std::uint32_t i = 0; i < lights.size(); ++i)
    EXPECT_NEAR(lights.prob(here.p, front, i, same), lights.prob(here.p, front, i), 1e-6) << i;

  for (std::size_t group = 0; group < by_group.size(); ++group)
    by_group[group] = static_cast<std::uint8_t>(group % 3 == 0 ? 16 : 255 - group);
  const scene::ChoiceWeights weights = lights.weights(by_group, room);
  std::vector<double> prob(lights.size());
  double sum = 0;
  for (std::uint32_t i = 0; i < lights.size(); ++i) {
    prob[i] = static_cast<double>(lights.prob(here.p, front, i, weights));
    EXPECT_EQ(prob[i] > 0, lights.prob(here.p, front, i) > 0) << i;
    sum += prob[i];
  }
  EXPECT_NEAR(sum, 1, 1e-5);
  // Beside each other in the tree, with importances nearly alike: the weights decide.
  double light = 0, heavy = 0;
  for (std::uint32_t i = 0; i < lights.size(); ++i)
    (by_group[lights.group(i)] == 16 ? light : heavy) +=
        prob[i] / static_cast<double>(lights.prob(here.p, front, i));
  EXPECT_LT(light / heavy, 0.25);
  expect_drawn(lights, here, front, weights, prob, 1e-4);
}

// Claim: what needs sums of one system is refused, with the setting's name.
TEST(IntegratorTrained, RefusesOptimalWeights) {
  for (const auto& [name, value] : {std::pair{"weights", "optimal"}, {"estimator", "direct"}}) {
    const auto settings =
        render::complete_integrator_settings("optimis", {}, {{"selection", "trained"}, {name, value}});
    ASSERT_FALSE(settings.ok()) << value;
    EXPECT_EQ(settings.error().field, name) << settings.error().to_string();
  }
}

}  // namespace
}  // namespace candela
