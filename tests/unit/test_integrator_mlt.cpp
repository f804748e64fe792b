// mlt's settings: presets of mutations, and shares.
#include <gtest/gtest.h>

#include <string>

#include "worker/integrators/makers.h"

namespace candela::integrators {
namespace {

// Claim: a share beside a preset is an error that names both, and without a preset one share is above 0.
TEST(IntegratorMlt, PresetsHaveTheirOwnShares) {
  const scene::SceneFeatures features;
  for (const std::string preset : {"none", "mlt", "memlt", "hslt"})
    EXPECT_TRUE(make_mlt_integrator({{"preset", preset}}, features).ok()) << preset;
  EXPECT_TRUE(make_mlt_integrator({{"preset", "none"}, {"lens", "0.5"}}, features).ok());
  const auto both = make_mlt_integrator({{"preset", "memlt"}, {"lens", "0.5"}}, features);
  ASSERT_FALSE(both.ok());
  EXPECT_EQ(both.error().kind, ErrorKind::usage);
  EXPECT_EQ(both.error().field, "lens");
  EXPECT_NE(both.error().to_string().find("memlt"), std::string::npos);
  EXPECT_FALSE(make_mlt_integrator({{"bidirectional", "0"}}, features).ok());
}

}  // namespace
}  // namespace candela::integrators
