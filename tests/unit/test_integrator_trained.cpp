// Light selection with weights, as trained selection of optimis chooses, and what it refuses.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/renderer_fixture.h"
#include "worker/scene/emitters/lights.h"

namespace candela {
namespace {

const std::string kThreeLampsAndSky =
    R"(<shape type="rectangle"><transform name="to_world"><scale value="3"/></transform></shape>
       <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate x="1" y="0" z="2"/></transform><emitter type="area"/></shape>
       <shape type="sphere"><point name="center" x="-1" y="0" z="1"/><float name="radius" value="0.3"/><emitter type="area"/></shape>
       <emitter type="point"><point name="position" x="0" y="1" z="1"/></emitter>
       <emitter type="constant"><rgb name="radiance" value="0.2"/></emitter>)";

// Claim: the choice has the probabilities that it tells, which are those of `contribution` times the weights,
// and densities of points agree with them. 5 standard errors for each emitter.
TEST(IntegratorTrained, ChoosesByTheProbabilitiesItTells) {
  auto built = test::build_scene(kThreeLampsAndSky, {}, "<sensor type=\"perspective\"/>");
  ASSERT_TRUE(built.ok()) << built.error().to_string();
  const scene::Lights& lights = (*built)->lights();
  const std::vector<std::uint8_t> weights = {16, 255, 100, 37};
  ASSERT_EQ(lights.size(), weights.size());
  scene::SurfaceHit here;
  here.p = {0.2f, 0.1f, 0};
  here.ng = {0, 0, 1};
  const Vec3 front = {0, 0, 1};
  double sum = 0, share = 0;
  std::vector<double> prob(weights.size()), chosen(weights.size());
  for (std::uint32_t i = 0; i < weights.size(); ++i) {
    prob[i] = static_cast<double>(lights.prob(here.p, front, i, weights));
    sum += prob[i];
    share += static_cast<double>(lights.prob(here.p, front, i)) * weights[i];
  }
  EXPECT_NEAR(sum, 1, 1e-6);
  for (std::uint32_t i = 0; i < weights.size(); ++i)
    EXPECT_NEAR(prob[i], static_cast<double>(lights.prob(here.p, front, i)) * weights[i] / share, 1e-6);
  constexpr int kDraws = 40000;
  samplers::Sampler sampler(samplers::SamplerKind::independent, 3);
  for (int k = 0; k < kDraws; ++k) {
    sampler.start(0, static_cast<std::uint64_t>(k), 0, 0);
    const float u_select = sampler.draw_1d(0, false);
    const Vec2 u = sampler.draw_2d(1, false);
    scene::DirectSample light;
    const auto outcome = lights.sample(here, front, u_select, u, light, weights, scene::PointSampler::own);
    ASSERT_NE(outcome, scene::DirectOutcome::failed);
    ASSERT_LT(light.emitter, weights.size());
    ++chosen[light.emitter];
    if (!light.infinite) continue;
    EXPECT_NEAR(static_cast<double>(light.pdf_solid_angle),
                static_cast<double>(lights.pdf_environment_solid_angle(here, front, light.wi, weights)),
                1e-5 * static_cast<double>(light.pdf_solid_angle));
  }
  for (std::size_t i = 0; i < weights.size(); ++i)
    EXPECT_NEAR(chosen[i] / kDraws, prob[i], 5 * std::sqrt(prob[i] * (1 - prob[i]) / kDraws) + 1e-9) << i;
}

// Claim: what needs sums of one system is refused, with the setting's name.
TEST(IntegratorTrained, RefusesOptimalWeights) {
  for (const auto& [name, value] : {std::pair{"weights", "optimal"},
                                    {"weights", "best"},
                                    {"estimator", "progressive"},
                                    {"estimator", "fan"}}) {
    const auto settings =
        render::complete_integrator_settings("optimis", {}, {{"selection", "trained"}, {name, value}});
    ASSERT_FALSE(settings.ok()) << value;
    EXPECT_EQ(settings.error().field, name) << settings.error().to_string();
  }
}

}  // namespace
}  // namespace candela
