// Hostile scenes of pbrt's version 4: each is a scene or one error with a place.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "common/description/reading.h"
#include "common/description/review.h"
#include "test_description_common.h"
#include "tests/unit/description_pbrt_reading.h"

namespace candela::description {
namespace {

// Claim: chains of textures and materials of any length end in an error, not on the stack.
TEST(DescriptionPbrtHostile, DeepChainsAreErrors) {
  std::string textures =
      "WorldBegin\nTexture \"t0\" \"float\" \"imagemap\" \"string filename\" \"image.png\"\n";
  std::string materials = "WorldBegin\nMakeNamedMaterial \"m0\" \"string type\" \"diffuse\"\n";
  constexpr int kLength = 50'000;
  for (int i = 1; i <= kLength; ++i) {
    textures += fmt::format("Texture \"t{}\" \"float\" \"scale\" \"texture tex\" \"t{}\"\n", i, i - 1);
    materials += fmt::format(
        "MakeNamedMaterial \"m{}\" \"string type\" \"mix\" \"string materials\" [\"m0\" \"m{}\"]\n", i,
        i - 1);
  }
  textures += fmt::format("Shape \"sphere\" \"texture alpha\" \"t{}\"\n", kLength);
  materials += fmt::format("NamedMaterial \"m{}\"\nShape \"sphere\"\n", kLength);
  EXPECT_NE(outcome_of(read_pbrt(textures)).find("textures are nested deeper than 64 levels"),
            std::string::npos);
  EXPECT_NE(outcome_of(read_pbrt(materials)).find("materials are nested deeper than 64 levels"),
            std::string::npos);
}

// Claim: textures and materials in which each level names the next twice are errors that name the line, in
// both formats, before a lookup or a walk doubles with each level.
TEST(DescriptionPbrtHostile, GraphsThatUnfoldAreErrors) {
  std::string textures = "WorldBegin\nTexture \"t0\" \"spectrum\" \"checkerboard\"\n";
  std::string materials = "WorldBegin\nMakeNamedMaterial \"m0\" \"string type\" \"diffuse\"\n";
  std::string xml = "<texture type='checkerboard' id='t0'/>";
  for (int i = 1; i <= 60; ++i) {
    textures += fmt::format(
        "Texture \"t{}\" \"spectrum\" \"mix\" \"texture tex1\" \"t{}\" \"texture tex2\" \"t{}\"\n", i, i - 1,
        i - 1);
    materials += fmt::format(
        "MakeNamedMaterial \"m{}\" \"string type\" \"mix\" \"string materials\" [\"m{}\" \"m{}\"]\n", i,
        i - 1, i - 1);
    xml += fmt::format(
        "\n<texture type='mix' id='t{}'><ref name='color0' id='t{}'/><ref name='color1' id='t{}'/></texture>",
        i, i - 1, i - 1);
  }
  // 2^12 boards and as many mixes are fewer than 10,000.
  EXPECT_EQ(outcome_of(read_pbrt(textures +
                                 "Material \"diffuse\" \"texture reflectance\" \"t60\"\nShape \"sphere\"")),
            "scene.pbrt:15: the texture 't13' unfolds into more than 10000 textures (name textures that are "
            "made of "
            "others only once)");
  EXPECT_EQ(outcome_of(read_pbrt(textures +
                                 "Material \"diffuse\" \"texture reflectance\" \"t12\"\nShape \"sphere\"")),
            "ok");
  EXPECT_EQ(
      outcome_of(read_pbrt(materials + "NamedMaterial \"m60\"\nShape \"sphere\"")),
      "scene.pbrt:15: the mix is made of more than 10000 materials (name mixes in other mixes only once)");
  const auto read = parse_text("<scene version='3.0.0'>" + xml + "</scene>");
  EXPECT_EQ(outcome(read), "scene.xml:14: texture 'mix' unfolds into more than 10000 textures");
}

// Claim: whatever the bytes, the answer is a scene or one error with a place.
TEST(DescriptionPbrtHostile, MutatedScenesAreScenesOrErrors) {
  const std::string seed = R"(LookAt 0 1 -4 0 1 0 0 1 0
Film "rgb" "integer xresolution" 32 "float cropwindow" [0 1 .25 1]
Camera "perspective" "float fov" 45 "float screenwindow" [-1 2 -1 1]
WorldBegin
Texture "t" "spectrum" "imagemap" "string filename" "image.png" "float scale" 0.5
MakeNamedMedium "fog" "string type" "homogeneous" "string preset" "Skin1"
MakeNamedMaterial "g" "string type" "subsurface" "rgb sigma_a" [1 2 3]
AttributeBegin
  MediumInterface "fog" ""
  Material "diffuse" "texture reflectance" "t" "string normalmap" "image.png"
  Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]
AttributeEnd
ObjectBegin "o"
  NamedMaterial "g"
  Shape "sphere" "float zmax" 0.5
ObjectEnd
ObjectInstance "o"
LightSource "spot" "blackbody I" 5000 "point3 from" [0 1 0] "float power" 10
)";
  ASSERT_TRUE(read_pbrt(seed).ok()) << outcome_of(read_pbrt(seed));
  std::uint64_t state = 1;
  const auto below = [&](std::size_t n) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    return static_cast<std::size_t>((state >> 33) % n);
  };
  std::size_t scenes = 0, errors = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string text = seed;
    for (std::size_t edits = 1 + below(3); edits > 0; --edits) {
      const std::size_t at = below(text.size());
      switch (below(4)) {
        case 0:
          text.erase(at, 1 + below(12));
          break;
        case 1:
          text[at] = static_cast<char>(below(256));
          break;
        case 2:
          text.insert(at, text.substr(below(text.size()), below(40)));
          break;
        default:
          if (const std::size_t digit = text.find_first_of("0123456789", at); digit != std::string::npos)
            text[digit] = static_cast<char>('0' + below(10));
      }
    }
    const auto read = read_pbrt(text, {}, {.integrator = {}, .lenient = i % 2 == 0});
    ++(read.ok() ? scenes : errors);
    if (read.ok())
      review(read->description);
    else
      EXPECT_EQ(read.error().kind, ErrorKind::input) << outcome_of(read);
  }
  EXPECT_GT(scenes, 200U);
  EXPECT_GT(errors, 200U);
}

}  // namespace
}  // namespace candela::description
