// The documentation page and the table of names.
#include <gtest/gtest.h>

#include <cstdlib>
#include <set>

#include "common/base/files.h"
#include "common/description/vocabulary.h"
#include "tests/paths.h"

namespace candela::description {
namespace {

// Claim: docs/plugins.md is what the loader does. With CANDELA_REWRITE_DOCS=1 the test writes the page.
TEST(DescriptionPage, CommittedPageIsTheTable) {
  const std::filesystem::path path = test::source_path("docs/plugins.md");
  if (std::getenv("CANDELA_REWRITE_DOCS") != nullptr) {
    ASSERT_TRUE(write_file_atomically(path, support_table_markdown()).ok());
  }
  const auto page = read_file(path, 1 << 20);
  ASSERT_TRUE(page.ok()) << page.error().to_string();
  EXPECT_EQ(*page, support_table_markdown())
      << "run this test with CANDELA_REWRITE_DOCS=1 and commit docs/plugins.md";
}

// Claim: the table has no plugin or parameter twice, and each says what it is.
TEST(DescriptionPage, TableIsWellFormed) {
  std::set<std::pair<std::string_view, std::string_view>> plugins;
  for (const PluginRule& plugin : vocabulary()) {
    EXPECT_TRUE(plugins.emplace(plugin.category, plugin.name).second) << plugin.name;
    EXPECT_FALSE(plugin.doc.empty()) << plugin.name;
    EXPECT_EQ(support_of_plugin(plugin.category, plugin.name), Support::none) << plugin.name;
    std::set<std::string_view> names;
    for (const PropertyRule& rule : plugin.properties) {
      EXPECT_TRUE(names.insert(rule.name).second) << rule.name;
      EXPECT_FALSE(rule.doc.empty() || (rule.types.empty() && !rule.textured)) << rule.name;
    }
  }
}

// Claim: the page names every parameter of every plugin: under the plugin, or, if all plugins of its category
// have it, before the first of them. What the parameter means stands in the category's section.
TEST(DescriptionPage, NamesEveryParameter) {
  const std::string page = support_table_markdown();
  for (const PluginRule& plugin : vocabulary()) {
    if (plugin.category == "scene") continue;
    const std::size_t begin = page.find("\n## " + std::string(plugin.category) + "\n");
    ASSERT_NE(begin, std::string::npos) << plugin.category;
    const std::string section = page.substr(begin, page.find("\n##", begin + 1) - begin);
    const std::string before = section.substr(0, section.find("\n**"));
    const std::string of_all = before.substr(0, before.find("\nParameters of several"));
    std::string own;
    for (std::size_t at = section.find("\n**`"); at != std::string::npos;
         at = section.find("\n**`", at + 1)) {
      const std::string part = section.substr(at, section.find("\n**`", at + 1) - at);
      const std::string names = part.substr(0, part.find("**:"));
      if (names.find("`" + std::string(plugin.name) + "`") != std::string::npos) own = part;
    }
    ASSERT_NE(own, "") << plugin.category << " " << plugin.name;
    for (const PropertyRule& rule : plugin.properties) {
      const std::string name = "`" + std::string(rule.name) + "`";
      EXPECT_TRUE(own.find(name) != std::string::npos || of_all.find(name) != std::string::npos)
          << plugin.name << " " << rule.name;
      EXPECT_NE(section.find(rule.doc), std::string::npos) << plugin.name << " " << rule.name;
    }
  }
}

// Claim: the nearest name is the one a person meant; far-off names get no suggestion.
TEST(DescriptionPage, NearestName) {
  const std::vector<std::string_view> known = {"max_depth", "rr_depth", "hide_emitters"};
  EXPECT_EQ(nearest_name("max_dpeth", known), "max_depth");
  EXPECT_EQ(nearest_name("maxDepth", known), "max_depth");
  EXPECT_EQ(nearest_name("RR_DEPTH", known), "rr_depth");
  EXPECT_EQ(nearest_name("spp", known), "");
  EXPECT_EQ(nearest_name("", known), "");
}

}  // namespace
}  // namespace candela::description
