// The table of integrators that tests share, against the registry.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/description/mutation_flags.h"
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

// Claim: a setting that is gone is passed over with the value that stands for what is done now, and refused
// with another one; nothing documents it.
TEST(IntegratorTable, RetiredSettingsKeepTheirLastValue) {
  struct Case {
    const char *integrator, *name, *kept, *refused;
  };
  for (const Case& c :
       {Case{"appm", "recursive_correction", "false", "true"}, Case{"optimis", "batch", "4", "3"},
        Case{"vcmplus", "test", "sectors", "antipodal"}, Case{"fppm", "test", "sectors", "nested"},
        Case{"fppm", "rings", "false", "true"}, Case{"fppm", "kappa", "3", "2"}}) {
    SCOPED_TRACE(c.integrator);
    const auto kept = render::complete_integrator_settings(c.integrator, {}, {{c.name, c.kept}});
    ASSERT_TRUE(kept.ok()) << kept.error().to_string();
    EXPECT_FALSE(kept->contains(c.name));
    const auto refused = render::complete_integrator_settings(c.integrator, {}, {{c.name, c.refused}});
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().field, c.name);
    const auto known = render::integrator_settings(c.integrator);
    ASSERT_TRUE(known.ok());
    for (const render::SettingDoc& setting : *known) EXPECT_NE(setting.name, c.name);
  }
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
    EXPECT_EQ(row.epochs, has("epoch_min") && has("radius"));
    SettingsMap small(row.small.begin(), row.small.end());
    EXPECT_TRUE(render::complete_integrator_settings(row.name, {}, small).ok());
  }
}

// Claim: bad settings of optimis are errors that name the setting.
TEST(IntegratorTable, BadSettingsOfOptimisAreNamed) {
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"techniques", "bdsf"},       {"techniques", "bsdf,bsdf"},
      {"techniques", ""},           {"selection", "random"},
      {"selection", "power,sun"},   {"weights", "best-guess"},
      {"estimator", "guess"},       {"depth", "3"},
      {"hide_emitters", "perhaps"}, {"plan", "none"},
      {"light_groups", "two"}};
  for (const auto& [name, value] : bad) {
    const auto refused = render::complete_integrator_settings("optimis", {}, {{name, value}});
    ASSERT_FALSE(refused.ok()) << name << '=' << value;
    EXPECT_EQ(refused.error().field, name) << refused.error().to_string();
  }
  const auto unknown = render::complete_integrator_settings("optimis", {}, {{"estimater", "direct"}});
  ASSERT_FALSE(unknown.ok());
  EXPECT_NE(unknown.error().to_string().find("'estimator'"), std::string::npos)
      << unknown.error().to_string();
}

// Claim: a parameter of an integrator that has an effect in a scene file is a setting of that integrator,
// which takes the values at the parameter's bounds. strict_normals alone is none: it belongs to the scene,
// for whichever integrator runs (docs/decisions/049).
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
      const auto mutation =
          std::find_if(description::kMutationFlags.begin(), description::kMutationFlags.end(),
                       [&](const auto& flag) { return flag.name == rule.name; });
      if (mutation != description::kMutationFlags.end()) {  // read by the client as a share
        // One mutation has to stay.
        const std::string setting(mutation->setting), stays = setting == "lens" ? "bidirectional" : "lens";
        for (const char* share : {"0", "1"})
          EXPECT_TRUE(
              render::complete_integrator_settings(row.name, {{setting, share}, {stays, "1"}}, {}).ok());
        continue;
      }
      if (rule.name == "strict_normals") {
        EXPECT_FALSE(takes(rule.name, "true"));
        continue;
      }
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

// The settings that follow from an effort.
SettingsMap settings_of(const std::string& integrator, const Effort& effort) {
  const auto some = render::integrator_settings_of_effort(integrator, effort);
  if (!some.ok()) throw std::runtime_error(some.error().to_string());
  const auto all = render::complete_integrator_settings(integrator, some.value(), {});
  if (!all.ok()) throw std::runtime_error(all.error().to_string());
  return all.value();
}
double number_of(const SettingsMap& settings, const std::string& name) {
  return std::stod(settings.at(name));
}

// Claim: what an effort in samples per pixel decides completes the settings of every integrator, and is spent
// to less than one round more; chains' bootstraps stay within a sixteenth of the work and the defaults.
TEST(IntegratorTable, EffortsAreSpentInWholeIterations) {
  for (const test::IntegratorRow& row : test::integrators()) {
    for (const std::uint64_t spp :
         {std::uint64_t{1}, std::uint64_t{5}, std::uint64_t{16}, std::uint64_t{100}, std::uint64_t{1} << 62})
      for (const std::uint64_t pixels : {std::uint64_t{1}, std::uint64_t{64 * 48}, std::uint64_t{1} << 32}) {
        SCOPED_TRACE(fmt::format("{}, {} spp, {} pixels", row.name, spp, pixels));
        const SettingsMap settings = settings_of(row.name, effort_of(spp, {}, pixels, 1));
        EXPECT_EQ(settings.contains("mutations"), row.chains);
        const auto each = render::samples_per_iteration(row.name, settings);
        ASSERT_TRUE(each.ok());
        EXPECT_EQ(each.value() > 1, row.chains && spp > 1);
        const std::uint64_t rounds = (spp + each.value() - 1) / each.value();
        EXPECT_LT(rounds * each.value() - spp, rounds);
        if (!row.chains) continue;
        const double bootstrap = number_of(settings, "bootstrap"), chains = number_of(settings, "chains");
        EXPECT_GE(bootstrap, 4 * chains);
        EXPECT_LE(bootstrap, 100000);
        const double work = static_cast<double>(spp) * static_cast<double>(pixels);
        EXPECT_LE(bootstrap, std::max(400.0, work / 16));
      }
  }
}

// Claim: chains' bootstrap and number follow the work whatever the limit that tells of it, and the least
// limit counts. The length of a segment follows samples a pixel alone.
TEST(IntegratorTable, EveryLimitTellsTheWork) {
  constexpr std::uint64_t kPixels = std::uint64_t{64} * 48;
  const SettingsMap defaults = settings_of("mmlt", effort_of(0, {.time_seconds = 1e6}, kPixels, 16));
  EXPECT_EQ(number_of(defaults, "chains"), 1000);
  EXPECT_EQ(number_of(defaults, "bootstrap"), 100000);
  EXPECT_EQ(number_of(defaults, "mutations"), 16);
  const StopRule limits[] = {{.iterations = 2}, {.time_seconds = 3}, {.relmse = 0.03}};
  for (const char* integrator : {"pssmlt", "mmlt"})
    for (const StopRule& limit : limits) {
      const Effort effort = effort_of(0, limit, kPixels, 16);
      const SettingsMap some = settings_of(integrator, effort);
      EXPECT_NEAR(number_of(some, "bootstrap"), static_cast<double>(effort.samples) / 16, 1);
      EXPECT_LT(number_of(some, "bootstrap"), 10000);
      EXPECT_EQ(number_of(some, "chains"), 100);
      EXPECT_EQ(number_of(some, "mutations"), 16);
      for (const StopRule& other : limits) {
        StopRule both = limit;
        both.iterations = std::max(both.iterations, other.iterations);
        both.time_seconds = std::max(both.time_seconds, other.time_seconds);
        both.relmse = std::max(both.relmse, other.relmse);
        EXPECT_EQ(effort_of(0, both, kPixels, 16).samples,
                  std::min(effort.samples, effort_of(0, other, kPixels, 16).samples));
      }
    }
  // Ten times the work: ten times the bootstrap, and as many chains for each of its samples as ever.
  const SettingsMap more = settings_of("mmlt", effort_of(0, {.iterations = 20}, kPixels, 16));
  EXPECT_EQ(number_of(more, "bootstrap"), 20 * kPixels);
  EXPECT_EQ(number_of(more, "chains"), 614);
  // The film's size has no part in what a time brings.
  EXPECT_EQ(effort_of(0, {.time_seconds = 3}, kPixels, 16).samples,
            effort_of(0, {.time_seconds = 3}, 1 << 24, 16).samples);
  EXPECT_EQ(effort_of(1ULL << 62, {}, 1ULL << 32, 1).samples, UINT64_MAX) << "more than fits";
}

}  // namespace
}  // namespace candela
