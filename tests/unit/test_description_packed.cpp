// Scene files that are packed by gzip.
#include <gtest/gtest.h>

#include "common/description/reading.h"
#include "tests/unit/description_pbrt_reading.h"
#include "tests/unit/gzip.h"

namespace candela::description {
namespace {

using test::gzip;

// Claim: packed files are read like others; damaged ones are an error.
TEST(PackedScenes, FilesAreUnpacked) {
  const std::string part = "Shape \"cylinder\"\n";
  const std::string packed = gzip(part);
  const std::string main = "WorldBegin\nInclude \"part.pbrt.gz\"";
  const auto read = read_pbrt(main, {{"part.pbrt.gz", packed}});
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  EXPECT_EQ(world_of(*read->description.scene), pbrt_world(part));
  const auto twice = read_pbrt(main, {{"part.pbrt.gz", packed + packed}});
  ASSERT_TRUE(twice.ok()) << outcome_of(twice);
  EXPECT_EQ(twice->description.scene->children_of("shape").size(), 2U);
  for (const std::string& damaged :
       {packed.substr(0, packed.size() - 9), std::string("no gzip"), std::string()}) {
    const auto bad = read_pbrt(main, {{"part.pbrt.gz", damaged}});
    EXPECT_NE(outcome_of(bad).find("the file is not packed by gzip, or is damaged"), std::string::npos)
        << outcome_of(bad);
  }
}

// Claim: scenes in XML and what they include may be packed too.
TEST(PackedScenes, XmlIsUnpacked) {
  const std::string part = "<scene version='3.0.0'><shape type='sphere'/></scene>";
  const std::string main =
      "<scene version='3.0.0'><include filename='part.xml.gz'/><shape type='ply'><string name='filename' "
      "value='mesh.ply.gz'/></shape></scene>";
  const MemorySource source(
      {{"scene.xml.gz", gzip(main)}, {"part.xml.gz", gzip(part)}, {"mesh.ply.gz", gzip("ply")}});
  const auto read = read_scene(source, "scene.xml.gz", {}, {});
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  EXPECT_EQ(read->description.scene->children_of("shape").size(), 2U);
  const auto damaged = read_scene(MemorySource({{"scene.xml.gz", main}}), "scene.xml.gz", {}, {});
  EXPECT_NE(outcome_of(damaged).find("not packed by gzip"), std::string::npos) << outcome_of(damaged);
}

// Claim: a packed scene file is unpacked up to the limit of its kind and no further: the error tells the
// limit, though the bytes beyond it are damaged. Packed meshes are not unpacked to learn whether they are
// there.
TEST(PackedScenes, FilesAreUnpackedUpToTheirLimit) {
  constexpr std::size_t mebibyte = std::size_t{1} << 20;
  const std::string part = gzip(std::string(mebibyte, ' '));
  std::string bomb;
  for (int i = 0; i < 260; ++i) bomb += part;
  bomb += "damage";
  const std::string main = "<scene version='3.0.0'><include filename='bomb.xml.gz'/></scene>";
  const auto include =
      read_scene(MemorySource({{"scene.xml", main}, {"bomb.xml.gz", bomb}}), "scene.xml", {}, {});
  EXPECT_NE(outcome_of(include).find("bomb.xml.gz"), std::string::npos) << outcome_of(include);
  EXPECT_NE(outcome_of(include).find("unpacks to more than 268435456 bytes"), std::string::npos)
      << outcome_of(include);
  const std::string spectrum = "LightSource \"point\" \"spectrum I\" \"bomb.spd.gz\"";
  const auto lamp = read_pbrt("WorldBegin\n" + spectrum, {{"bomb.spd.gz", bomb}});
  EXPECT_NE(outcome_of(lamp).find("unpacks to more than 16777216 bytes"), std::string::npos)
      << outcome_of(lamp);
  const std::string mesh =
      gzip("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n" + std::string(mebibyte, ' ')) + part +
      "damage";
  const auto pbrt =
      read_pbrt("WorldBegin\nShape \"plymesh\" \"string filename\" \"m.ply.gz\"", {{"m.ply.gz", mesh}});
  EXPECT_TRUE(pbrt.ok()) << outcome_of(pbrt);
  const auto xml =
      read_scene(MemorySource({{"scene.xml",
                                "<scene version='3.0.0'><shape type='ply'><string name='filename' "
                                "value='m.ply.gz'/></shape></scene>"},
                               {"m.ply.gz", mesh}}),
                 "scene.xml", {}, {});
  EXPECT_TRUE(xml.ok()) << outcome_of(xml);
}

}  // namespace
}  // namespace candela::description
