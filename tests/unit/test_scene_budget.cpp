// Scenes that are small as files and large when they are built, and a large one that fits.
#include <gtest/gtest.h>

#include "common/base/thread_cpu.h"
#include "common/description/reading.h"
#include "common/description/reading_budget.h"
#include "common/description/unpacked_files.h"
#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

constexpr std::uint64_t kMebibyte = std::uint64_t{1} << 20;

std::string repeated(const std::string& text, std::size_t count) {
  std::string result;
  for (std::size_t i = 0; i < count; ++i) result += text;
  return result;
}

Result<std::unique_ptr<Scene>> build_within(description::ReadingBudget& budget, const std::string& main,
                                            const std::map<std::string, std::string>& texts) {
  const test::TextFiles files(texts);
  const description::BudgetedFiles counted(files, budget);
  const description::UnpackedFiles unpacked(counted);
  CANDELA_ASSIGN(const description::ReadScene read, description::read_scene(counted, main, {}, {}));
  return Scene::build(read.description, unpacked, {});
}

std::string xml(const std::string& body) {
  return "<scene version='3.0.0'>\n<sensor type='perspective'/>\n" + body + "</scene>\n";
}

// Claim: shapes that are large when they are made are refused before they are, with their place and the
// option that raises the limit.
TEST(SceneBudget, LargeShapesOfSmallFilesAreRefused) {
  const std::string triangle =
      "\"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] \"integer levels\" 10\n";
  const std::string patch =
      "\"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1] \"integer indices\" [" + repeated(" 0 1 2 3", 20'000) + "]\n";
  const std::map<std::string, std::map<std::string, std::string>> kinds = {
      {"subdivision", {{"scene.pbrt", "WorldBegin\n" + repeated("Shape \"loopsubdiv\" " + triangle, 1)}}},
      {"patches", {{"scene.pbrt", "WorldBegin\nShape \"bilinearmesh\" " + patch}}},
      {"parts of spheres",
       {{"scene.pbrt", "WorldBegin\n" + repeated("Shape \"sphere\" \"float zmax\" 0.5\n", 1000)}}},
      {"height field",
       {{"scene.xml",
         xml("<shape type='heightfield'><integer name='width' value='2000'/><integer name='height' "
             "value='2000'/><texture type='checkerboard'/></shape>")}}},
  };
  for (const auto& [kind, files] : kinds) {
    SCOPED_TRACE(kind);
    description::ReadingBudget budget(64 * kMebibyte);
    double seconds = 0;
    const std::string main = files.begin()->first;
    const auto scene = with_cpu_time(seconds, [&] { return build_within(budget, main, files); });
    ASSERT_FALSE(scene.ok());
    const std::string told = scene.error().to_string();
    EXPECT_TRUE(told.starts_with(main + ":")) << told;
    EXPECT_NE(told.find("more memory than the 64 MiB that reading it may take"), std::string::npos) << told;
    EXPECT_NE(told.find("--scene-memory"), std::string::npos) << told;
    EXPECT_LT(seconds, 5) << told;
  }
}

// Claim: Embree's trees count: a budget that has room for the shapes alone is too small, and the error says
// for what.
TEST(SceneBudget, TheTreesOfEmbreeCount) {
  const std::string body = repeated("<shape type='sphere'/>\n", 5000);
  const std::map<std::string, std::string> files = {{"scene.xml", xml(body)}};
  description::ReadingBudget large(1024 * kMebibyte);
  ASSERT_TRUE(build_within(large, "scene.xml", files).ok());
  description::ReadingBudget small(large.used() - kMebibyte / 16);
  const auto scene = build_within(small, "scene.xml", files);
  ASSERT_FALSE(scene.ok());
  EXPECT_NE(scene.error().to_string().find("Embree's trees take"), std::string::npos)
      << scene.error().to_string();
  EXPECT_TRUE(scene.error().to_string().starts_with("scene.xml:")) << scene.error().to_string();
}

// Claim: 100,001 instances of a group of 200 spheres are built and seen within 512 MiB, and each is charged
// once, whatever its group holds.
TEST(SceneBudget, ManyInstancesOfALargeGroupAreBuilt) {
  std::string body = "<shape type='shapegroup' id='g'>";
  for (int i = 0; i < 200; ++i)
    body += fmt::format("<shape type='sphere'><point name='center' x='{}' y='{}' z='{}'/></shape>",
                        3 * (i % 6), 3 * (i / 6 % 6), 3 * (i / 36));
  body += "</shape>\n";
  constexpr int kSide = 317;  // 317 squared is 100,489
  for (int i = 0; i < 100'001; ++i)
    body += fmt::format(
        "<shape type='instance'><ref id='g'/><transform name='to_world'><translate x='{}' "
        "z='{}'/></transform>"
        "</shape>\n",
        20 * (i % kSide), 20 * (i / kSide));
  description::ReadingBudget budget(512 * kMebibyte);
  double seconds = 0;
  const auto scene = with_cpu_time(seconds, [&] {
    return build_within(budget, "scene.xml", {{"scene.xml", xml(body)}});
  });
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  std::printf("%.0f MiB, %.2f s of this thread\n",
              static_cast<double>(budget.used()) / static_cast<double>(kMebibyte), seconds);
  EXPECT_EQ((*scene)->features().instances, 100'001U);
  // From above onto the middle of the last instance's first sphere.
  const int last = 100'000;
  const auto x = static_cast<float>(20 * (last % kSide)), z = static_cast<float>(20 * (last / kSide));
  SurfaceHit hit;
  ASSERT_TRUE((*scene)->intersect({{x, -100, z}, {0, 1, 0}}, hit));
  EXPECT_NEAR(hit.p.y, -1, 1e-3);
}

}  // namespace
}  // namespace candela::scene
