// The table of integrators that tests share, against the registry.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/integrators.h"
#include "worker/render/renderer.h"

namespace candela {
namespace {

// Claim: tests know every integrator there is, and no other.
TEST(IntegratorTable, HasEveryIntegrator) {
  EXPECT_THAT(test::all_integrators(), testing::UnorderedElementsAreArray(render::integrator_names()));
}

// Claim: a row says of chains and of merging what the integrator's settings say.
TEST(IntegratorTable, RowsSayWhatTheIntegratorsDo) {
  for (const test::IntegratorRow& row : test::integrators()) {
    SCOPED_TRACE(row.name);
    const auto settings = render::integrator_settings(row.name);
    ASSERT_TRUE(settings.ok()) << settings.error().to_string();
    const auto has = [&](std::string_view name) {
      return std::any_of(settings->begin(), settings->end(),
                         [&](const render::SettingDoc& setting) { return setting.name == name; });
    };
    EXPECT_EQ(row.chains, has("chains"));
    EXPECT_EQ(row.merges, has("radius"));
    SettingsMap small(row.small.begin(), row.small.end());
    EXPECT_TRUE(render::complete_integrator_settings(row.name, {}, small).ok());
  }
}

}  // namespace
}  // namespace candela
