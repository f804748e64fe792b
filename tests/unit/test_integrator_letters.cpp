// Renderers of jobs with layers by light path expressions.
#include <gtest/gtest.h>

#include "tests/unit/renderer_fixture.h"

namespace candela::integrators {
namespace {

const test::TextFiles kFiles(std::map<std::string, std::string>{
    {"scene.xml", R"(<scene version="3.0.0"><integrator type="path"/>
  <sensor type="perspective"/><shape type="sphere" id="ball"/>
  <emitter type="constant" id="sky"/>
  <emitter type="point" id="dark"><rgb name="intensity" value="0, 0, 0"/></emitter></scene>)"}});

Result<PilotResult> pilot_of(const std::string& integrator, const std::string& layers) {
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = 4;
  job.layers = layers;
  CANDELA_ASSIGN(job.integrator_settings, render::complete_integrator_settings(integrator, {}, {}));
  CANDELA_ASSIGN(const auto renderer, render::Renderer::create(kFiles, "scene.xml", {}, job, 1));
  return renderer->pilot({1});
}

// Claim: an expression may name a lamp that is black, which no path begins at; light groups have its layer.
TEST(LetterRenderers, KnowBlackLamps) {
  const auto named = pilot_of("path", "layer a=L{dark}[DGSV]*E");
  ASSERT_TRUE(named.ok()) << named.error().to_string();
  EXPECT_EQ(named->work.layers, std::vector<std::string>{"a"});
  const auto groups = pilot_of("path", "light-groups");
  ASSERT_TRUE(groups.ok()) << groups.error().to_string();
  EXPECT_EQ(groups->work.layers, (std::vector<std::string>{"light.sky", "light.dark"}));
}

// Claim: a name that would be taken for the second part of a layer of chains is refused; others may have it.
TEST(LetterRenderers, KeepNamesOfSecondPartsFree) {
  EXPECT_TRUE(pilot_of("path", "layer a.independent=LE").ok());
  const auto refused = pilot_of("pssmlt", "layer a.independent=LE");
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().to_string().find("a.independent"), std::string::npos);
}

}  // namespace
}  // namespace candela::integrators
