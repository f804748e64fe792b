// Things that pbrt's file format documents and Candela lacks are read as the nearest thing, and
// `candela check` tells the difference with its line.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/description/reading.h"
#include "test_description_common.h"
#include "tests/unit/description_pbrt_reading.h"

namespace candela::description {
namespace {

struct Documented {
  std::string text;  // options and world
  std::string note;  // a part of one of its notes
};

std::string told(const ReadScene& read) {
  std::string all;
  for (const Note& note : read.description.notes)
    all += fmt::format("{}:{}: {}\n", note.where.file, note.where.line, note.text);
  return all;
}

// Claim: each plugin of pbrt's documentation is read without --lenient; a difference is told with its place.
TEST(DescriptionPbrtDifferences, DocumentedPluginsAreReadAndTold) {
  const std::string surface = "\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"";
  const auto texture = [&](const std::string& type) {
    return "WorldBegin\nTexture \"t\" \"spectrum\" \"" + type + surface;
  };
  const auto medium = [](const std::string& parameters) {
    return "WorldBegin\nMakeNamedMedium \"m\" \"string type\" " + parameters +
           "\nMediumInterface \"m\" \"\"\nMaterial \"interface\"\nShape \"sphere\"";
  };
  const std::vector<Documented> all = {
      {texture("bilerp\" \"rgb v00\" [1 0 0]"), "scene.pbrt:2: texture 'bilerp' is the constant of its mean"},
      {texture("directionmix\""), "texture 'directionmix' is the constant of its mean"},
      {texture("dots\""), "texture 'dots' is the constant of its mean"},
      {"WorldBegin\nTexture \"a\" \"spectrum\" \"imagemap\" \"string filename\" \"image.png\"\n" +
           texture("directionmix\" \"texture tex1\" \"a\" \"texture tex2\" \"a\"").substr(11),
       "texture 'directionmix' is"},
      {texture("fbm\" \"integer octaves\" 4"), "texture 'fbm' is the constant of its mean"},
      {texture("marble\" \"float variation\" 0.4"), "texture 'marble' is the constant of its mean"},
      {texture("ptex\" \"string filename\" \"a.ptx\""), "texture 'ptex' is the constant of its mean"},
      {texture("windy\""), "texture 'windy' is the constant of its mean"},
      {texture("wrinkled\""), "texture 'wrinkled' is the constant of its mean"},
      {texture("checkerboard\" \"integer dimension\" 3"), "3 dimensions follows the surface's u and v"},
      {texture("imagemap\" \"string filename\" \"image.png\" \"string mapping\" \"planar\" \"vector3 v1\" "
               "[1 0 0]"),
       "the mapping 'planar' of a texture follows the surface's u and v"},
      {texture("imagemap\" \"string filename\" \"image.png\" \"string wrap\" \"octahedralsphere\""),
       "'octahedralsphere' is 'repeat'"},
      {texture("imagemap\" \"string filename\" \"image.png\" \"bool invert\" true"),
       "its luminance is inverted"},
      {"WorldBegin\nMaterial \"hair\" \"float eumelanin\" 2\nShape \"sphere\"",
       "scene.pbrt:2: material 'hair' is 'roughplastic' of the hair's color"},
      {"WorldBegin\nMaterial \"hair\" \"rgb color\" [.5 .5 .5] \"float beta_m\" .5\nShape \"sphere\"",
       "material 'hair' is 'roughplastic'"},
      {"WorldBegin\nMaterial \"measured\" \"string filename\" \"image.png\"\nShape \"sphere\"",
       "material 'measured' is 'diffuse'"},
      {"ColorSpace \"rec2020\"\nWorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [1 0 0]\nShape "
       "\"sphere\"",
       "scene.pbrt:3: the color 1, 0, 0 of rec2020 is outside of Rec.709: 1, 0, 0 is taken"},
      {"ColorSpace \"dci-p3\"\nWorldBegin\nLightSource \"infinite\" \"rgb L\" [0 2 0]",
       "scene.pbrt:3: the color 0, 2, 0 of dci-p3 is outside of Rec.709: 0, 2.084, 0 is taken"},
      {"WorldBegin\nLightSource \"goniometric\" \"rgb I\" [1 1 1]", "without a picture is a point light"},
      {"WorldBegin\nAreaLightSource \"diffuse\" \"float power\" 3\nShape \"trianglemesh\" \"point3 P\" [0 0 "
       "0 1 0 "
       "0 0 1 0]",
       "scene.pbrt:3: the power of an area light is the whole shape's"},
      {"WorldBegin\nShape \"plymesh\" \"string filename\" \"image.png\" \"texture displacement\" \"t\"",
       "the displacement of a mesh is passed over"},
      {medium("\"cloud\" \"float density\" 2 \"float wispiness\" 0.5"), "sampled on a grid of 128"},
      {medium(
           "\"nanovdb\" \"string filename\" \"image.png\" \"float LeScale\" 5 \"float temperaturecutoff\" 1"),
       "a medium 'nanovdb' does not glow"},
      {medium("\"homogeneous\" \"rgb Le\" [1 1 1] \"float Lescale\" 2"), "'Le' is passed over"},
      {medium("\"uniformgrid\" \"float density\" 1 \"float temperature\" 500"),
       "'temperature' is passed over"},
      {"ColorSpace \"rec2020\"\n" + medium("\"rgbgrid\" \"rgb sigma_a\" [1 1 1]"), "taken for Rec.709"},
      {"Camera \"spherical\" \"string mapping\" \"equalarea\"\nWorldBegin", "it sees 90 degrees"},
      {"Camera \"realistic\" \"string lensfile\" \"lens.dat\"\nWorldBegin", "is a thin lens of the same"},
      {"Integrator \"ambientocclusion\" \"float maxdistance\" 3\nWorldBegin",
       "is 'path', which computes light"},
      {"WorldBegin\nMaterial \"coateddiffuse\" \"float roughness\" .1\nShape \"sphere\"",
       "3 to 37 % brighter"},
      {"WorldBegin\nMaterial \"coateddiffuse\" \"float uroughness\" .1 \"float vroughness\" .2\nShape "
       "\"sphere\"",
       "has the mean of its two roughnesses"},
      {"WorldBegin\nLightSource \"infinite\" \"string filename\" \"image.png\" \"float illuminance\" 4",
       "scene.pbrt:2: the picture of an infinite light has the given 'illuminance'; pbrt counts half of its "
       "light"},
      {medium("\"homogeneous\"") + " \"float alpha\" .5",
       "light that passes the holes of a shape of an alpha below 1 enters the medium behind"},
      {"WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"homogeneous\"\nMediumInterface \"m\" \"\"\nShape "
       "\"sphere\" \"float alpha\" .5",
       "light that the inner side of a shape of an alpha below 1 reflects stays in the medium"},
      {"Integrator \"randomwalk\" \"integer maxdepth\" 3\nWorldBegin", ""}};
  for (const Documented& one : all) {
    const auto read = read_pbrt(one.text, {{"lens.dat", "20 2 1.5 10\n0 1 0 8\n-20 50 1 10\n"}});
    ASSERT_TRUE(read.ok()) << one.text << "\n" << outcome_of(read);
    EXPECT_TRUE(read->passed_over.empty()) << one.text;
    EXPECT_NE(told(*read).find(one.note), std::string::npos) << one.text << "\n" << told(*read);
  }
}

// Claim: named spectra of pbrt's documentation are read, lights with a luminance of 1.
TEST(DescriptionPbrtDifferences, NamedSpectraAreRead) {
  for (const char* name :
       {"glass-BK7", "glass-BAF10", "glass-FK51A", "glass-LASF9", "glass-SF5", "glass-SF10", "glass-SF11"}) {
    const auto read = read_pbrt(
        fmt::format("WorldBegin\nMaterial \"dielectric\" \"spectrum eta\" \"{}\"\nShape \"sphere\"", name));
    EXPECT_TRUE(read.ok()) << name << outcome_of(read);
  }
  for (const char* name : {"Ag", "Al", "Au", "Cu", "CuZn", "MgO", "TiO2"}) {
    const auto read = read_pbrt(
        fmt::format("WorldBegin\nMaterial \"conductor\" \"spectrum eta\" \"metal-{}-eta\" \"spectrum k\" "
                    "\"metal-{}-k\"\nShape \"sphere\"",
                    name, name));
    EXPECT_TRUE(read.ok()) << name << outcome_of(read);
  }
  std::vector<std::string> lights = {"stdillum-A", "stdillum-D50", "stdillum-D65", "illum-acesD60"};
  for (int i = 1; i <= 12; ++i) lights.push_back(fmt::format("stdillum-F{}", i));
  for (const std::string& name : lights) {
    const auto read = read_pbrt("WorldBegin\nLightSource \"infinite\" \"spectrum L\" \"" + name + "\"");
    ASSERT_TRUE(read.ok()) << name << outcome_of(read);
    const Vec3 c = read->description.scene->children_of("emitter").at(0)->get_rgb("radiance")->value;
    EXPECT_NEAR(0.212671 * c[0] + 0.715160 * c[1] + 0.072169 * c[2], 1, 1e-3) << name;
  }
}

// Claim: a realistic camera is the thin lens of its surfaces: for two thin glasses the lensmaker's equation
// gives the focal length; the exposure is the solid angle of the pupil.
TEST(DescriptionPbrtDifferences, RealisticCamerasAreThinLenses) {
  // 1 / f = (n - 1) (1 / r + 1 / r) for a lens of no thickness: f = r = 40 mm of n = 1.5; the stop is open
  // to 8 mm behind it.
  const Files files = {{"lens.dat", "# a lens\n40 0 1.5 20\n-40 1 1 20\n0 40 0 8\n"}};
  const auto read = read_pbrt(
      "Film \"rgb\" \"integer xresolution\" 400 \"integer yresolution\" 300 \"float diagonal\" 50\n"
      "Camera \"realistic\" \"string lensfile\" \"lens.dat\" \"float aperturediameter\" 4 \"float "
      "focusdistance\" 2\nWorldBegin\nLightSource \"infinite\"",
      files);
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  const Object& scene = *read->description.scene;
  const ObjectPtr sensor = scene.children_of("sensor").at(0);
  EXPECT_EQ(sensor->plugin, "thinlens");
  // The ray at height 1 reaches the stop, 1 mm behind, at 1 - 1 / 40.
  EXPECT_NEAR(sensor->get_number("aperture_radius", 0), 0.002 / (1 - 1.0 / 40), 1e-9);
  EXPECT_NEAR(sensor->get_number("focus_distance", 0), 2, 1e-9);
  // A film of 40 mm by 30 mm at the distance of the image: its diagonal is that of the 35 mm frame.
  const double image = 0.04 * 2 / (2 - 0.04);
  EXPECT_NEAR(std::stod(sensor->get_string("focal_length", "0")),
              std::sqrt(36.0 * 36 + 24 * 24) / 2 / (0.025 / image), 1e-6);
  const double ratio = 0.002 / (1 - 1.0 / 40) / image;
  EXPECT_NEAR(scene.children_of("emitter").at(0)->get_rgb("radiance")->value[0], M_PI * ratio * ratio, 1e-9);

  const auto outcome_with = [&](const std::string& lens, const std::string& rest) {
    return outcome_of(
        read_pbrt("Camera \"realistic\" \"string lensfile\" \"lens.dat\"" + rest + "\nWorldBegin",
                  {{"lens.dat", lens}}));
  };
  EXPECT_NE(outcome_with("40 0 1.5\n", "").find("3 numbers, not four"), std::string::npos);
  EXPECT_NE(outcome_with("\n40 0 x 3\n", "").find("lens.dat:2: 'x' is no finite number"), std::string::npos);
  EXPECT_NE(outcome_with("-40 0 1.5 3\n40 1 1 3", "").find("do not gather light"), std::string::npos);
  EXPECT_NE(outcome_with("40 0 1.5 3\n-40 1 1 3", " \"float focusdistance\" 0.01").find("focusdistance"),
            std::string::npos);
  EXPECT_NE(outcome_of(read_pbrt("Camera \"realistic\"\nWorldBegin")).find("needs a lens file"),
            std::string::npos);
}

// Claim: nothing of a cloud is outside of its box.
TEST(DescriptionPbrtDifferences, CloudsEndAtTheirBox) {
  const auto read = read_pbrt(
      "WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"cloud\"\nMediumInterface \"m\" \"\"\n"
      "Material \"interface\"\nShape \"sphere\" \"float radius\" 5");
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  const ObjectPtr medium = read->description.scene->children_of("shape").at(0)->children_of("medium").at(0);
  EXPECT_EQ(medium->children_of("volume").at(0)->get_string("wrap_mode", ""), "zero");
}

// Claim: hair has the color that pbrt's pigments give it at the default roughness.
TEST(DescriptionPbrtDifferences, HairHasItsColor) {
  const auto read = read_pbrt("WorldBegin\nMaterial \"hair\" \"float eumelanin\" 0.3\nShape \"sphere\"");
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  const ObjectPtr bsdf = read->description.scene->children_of("shape").at(0)->children_of("bsdf").at(0);
  const ObjectPtr coat = bsdf->children_of("bsdf").at(0);
  EXPECT_EQ(coat->get_number("int_ior", 0), 1.55);
  const Vec3 color = coat->get_rgb("diffuse_reflectance")->value;
  // sigma_a = (ln c / f(beta_n))^2 [Chiang et al. 2016], the inverse of the color.
  const double b = 0.3, f = 5.969 - 0.215 * b + 2.532 * b * b - 10.73 * std::pow(b, 3) +
                            5.574 * std::pow(b, 4) + 0.245 * std::pow(b, 5);
  const Vec3 eumelanin = {0.419, 0.697, 1.37};
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(std::pow(std::log(color[i]) / f, 2), 0.3 * eumelanin[i], 1e-9);
  // A textured pigment is pbrt's default of it, which is told.
  const auto textured = read_pbrt(
      "WorldBegin\nTexture \"a\" \"float\" \"imagemap\" \"string filename\" \"image.png\"\n"
      "Material \"hair\" \"texture eumelanin\" \"a\"\nShape \"sphere\"");
  ASSERT_TRUE(textured.ok()) << outcome_of(textured);
  EXPECT_NE(told(*textured).find("a texture as 'eumelanin' of material 'hair' is the constant 1.3"),
            std::string::npos)
      << told(*textured);
  const Vec3 dark = textured->description.scene->children_of("shape")
                        .at(0)
                        ->children_of("bsdf")
                        .at(0)
                        ->children_of("bsdf")
                        .at(0)
                        ->get_rgb("diffuse_reflectance")
                        ->value;
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(std::pow(std::log(dark[i]) / f, 2), 1.3 * eumelanin[i], 1e-9);
}

}  // namespace
}  // namespace candela::description
