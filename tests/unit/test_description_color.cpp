#include <gtest/gtest.h>

#include "common/description/color.h"
#include "tests/unit/test_description_common.h"

namespace candela::description {
namespace {

// Claim: a scene has color if a spectrum of it is not gray, or if it has what may not be; a thing that two
// refer to is looked at too.
TEST(SceneColor, IsSeenInSpectraPicturesAndMaterials) {
  const auto colored = [](const std::string& body) {
    const auto scene = parse_text("<scene version='3.0.0'>" + body + "</scene>");
    EXPECT_TRUE(scene.ok()) << outcome(scene);
    return scene.ok() && has_color(*scene->scene);
  };
  const auto sphere = [](const std::string& bsdf) { return "<shape type='sphere'>" + bsdf + "</shape>"; };
  EXPECT_FALSE(colored(""));
  EXPECT_FALSE(colored(sphere("<bsdf type='diffuse'><rgb name='reflectance' value='0.5'/></bsdf>")));
  EXPECT_FALSE(colored("<emitter type='constant'><rgb name='radiance' value='2, 2, 2'/></emitter>"));
  EXPECT_FALSE(colored(sphere("<bsdf type='roughdielectric'/>")));
  EXPECT_TRUE(colored(sphere("<bsdf type='diffuse'><rgb name='reflectance' value='0.5, 0.5, 0.4'/></bsdf>")));
  EXPECT_TRUE(colored("<emitter type='constant'><rgb name='radiance' value='2, 2, 1'/></emitter>"));
  EXPECT_TRUE(colored(sphere("<bsdf type='conductor'><string name='material' value='Au'/></bsdf>")));
  EXPECT_TRUE(colored("<emitter type='sunsky'/>"));
  EXPECT_TRUE(
      colored(sphere("<bsdf type='diffuse'><texture type='bitmap' name='reflectance'>"
                     "<string name='filename' value='image.png'/></texture></bsdf>")));
  EXPECT_TRUE(
      colored("<bsdf type='twosided' id='b'><bsdf type='diffuse'><rgb name='reflectance' value='1, 0, 0'/>"
              "</bsdf></bsdf>" +
              sphere("<ref id='b'/>") + sphere("<ref id='b'/>")));
}

}  // namespace
}  // namespace candela::description
