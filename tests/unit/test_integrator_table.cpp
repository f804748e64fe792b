// The table of integrators that tests share, against the registry.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/description/vocabulary.h"
#include "common/job/integrator_words.h"
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
    EXPECT_EQ(row.epochs, has("epoch_min"));
    SettingsMap small(row.small.begin(), row.small.end());
    EXPECT_TRUE(render::complete_integrator_settings(row.name, {}, small).ok());
  }
}

// Claim: a parameter of an integrator that has an effect in a scene file is a setting of that integrator,
// which takes the values at the parameter's bounds.
TEST(IntegratorTable, SettingsTakeWhatSceneFilesMaySay) {
  for (const test::IntegratorRow& row : test::integrators()) {
    const auto* plugin = description::find_plugin("integrator", row.name);
    ASSERT_NE(plugin, nullptr) << row.name;
    const auto takes = [&](std::string_view name, const std::string& value) {
      return render::complete_integrator_settings(row.name, {{std::string(name), value}}, {}).ok();
    };
    for (const description::PropertyRule& rule : plugin->properties) {
      if (rule.ignored || !rule.only.empty()) continue;
      SCOPED_TRACE(fmt::format("{}.{}", row.name, rule.name));
      ASSERT_EQ(rule.types.size(), 1U);
      if (rule.types.front() == description::PropertyType::boolean) {
        EXPECT_TRUE(takes(rule.name, "true") && takes(rule.name, "false"));
        EXPECT_FALSE(takes(rule.name, "1"));
        continue;
      }
      EXPECT_EQ(takes(rule.name, fmt::format("{}", rule.minimum)), !rule.above_minimum);
      if (std::isfinite(rule.maximum)) {
        EXPECT_TRUE(takes(rule.name, fmt::format("{}", rule.maximum)));
        EXPECT_FALSE(takes(rule.name, fmt::format("{}", rule.maximum + 1)));
      }
    }
  }
}

// Claim: the shared words name the renderer's integrators and no other; so does the vocabulary of scene
// files.
TEST(IntegratorTable, WordsNameEveryIntegrator) {
  std::vector<std::string> names;
  for (const auto& words : integrator_words::kIntegrators) names.emplace_back(words.name);
  EXPECT_THAT(names, testing::UnorderedElementsAreArray(render::integrator_names()));
  EXPECT_THAT(description::plugin_names("integrator"), testing::UnorderedElementsAreArray(names));
}

// Claim: an integrator's settings start from the defaults that its shared words tell readers of, and it has
// alpha if they say so.
TEST(IntegratorTable, SettingsHaveTheDefaultsOfTheirWords) {
  for (const auto& words : integrator_words::kIntegrators) {
    SCOPED_TRACE(words.name);
    const auto defaults = render::complete_integrator_settings(std::string(words.name), {}, {});
    ASSERT_TRUE(defaults.ok()) << defaults.error().to_string();
    EXPECT_EQ(defaults->at("max_depth"), "-1");
    EXPECT_EQ(defaults->at("rr_depth"), std::to_string(words.rr_depth));
    EXPECT_EQ(defaults->at("hide_emitters"), "false");
    ASSERT_EQ(defaults->contains("alpha"), !words.alpha.text.empty());
    if (words.alpha.text.empty()) continue;
    EXPECT_EQ(std::stod(defaults->at("alpha")), words.alpha.value);
  }
}

}  // namespace
}  // namespace candela
