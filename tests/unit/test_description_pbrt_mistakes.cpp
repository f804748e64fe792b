// Mistakes in scenes of pbrt's version 4, and what pbrt itself passes over: errors and warnings.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/description/reading.h"
#include "test_description_common.h"
#include "tests/unit/description_pbrt_reading.h"

namespace candela::description {
namespace {

struct Mistake {
  std::string world, strict, lenient;  // messages; "ok": none
};

// Claim: what is not understood is one error that names the place and the nearest name; with --lenient what
// can be replaced is replaced and told.
TEST(DescriptionPbrt, MistakesAreNamed) {
  const std::vector<Mistake> mistakes = {
      {"Shap \"sphere\"", "unknown directive 'Shap' (did you mean 'Shape'?)", ""},
      {"Shape \"sphera\"", "unknown shape 'sphera' (did you mean 'sphere'?)",
       "unknown shape 'sphera': it is left out (did you mean 'sphere'?)"},
      {"Material \"difuse\"", "unknown material 'difuse' (did you mean 'diffuse'?)", "ok"},
      {"Shape \"sphere\" \"float radus\" 1",
       "shape 'sphere' has no parameter 'radus' (did you mean 'radius'?)",
       "shape 'sphere' has no parameter 'radus': it is passed over (did you mean 'radius'?)"},
      {"Shape \"sphere\" \"string radius\" \"1\"",
       "parameter 'radius' of shape 'sphere' has a type that it cannot have: 'string' (with --lenient it is "
       "passed over)",
       "parameter 'radius' of shape"},
      {"Shape \"sphere\" \"floot radius\" 1", "unknown type of a parameter 'floot' (did you mean 'float'?)",
       ""},
      {"Shape \"sphere\" \"float radius\" [1 2]", "parameter 'radius' needs 1 value", ""},
      {"Shape \"sphere\" \"float radius\" nan", "'nan' is no finite number (parameter 'radius')", ""},
      {"Shape \"trianglemesh\" \"integer indices\" [0 1 2.5]",
       "'2.5' is no whole number (parameter 'indices')", ""},
      {"Shape \"trianglemesh\" \"point3 P\" [0 1\n2.5x 3]", "'2.5x' is no finite number (parameter 'P')", ""},
      {"Shape \"trianglemesh\" \"point3 P\" [0 1 2.5 3]", "parameter 'P' has 4 numbers, but a point3 has 3",
       ""},
      {"Shape \"trianglemesh\" \"point3 P\" [0 1 2.5", "the file ends within the values of parameter 'P'",
       ""},
      {"Shape \"sphere\" \"color c\" [1 1 1]",
       "the type 'color' is of pbrt's version 3 (write 'rgb', or convert the file with pbrt --upgrade)", ""},
      {"NamedMaterial \"x\"\nShape \"sphere\"", "unknown named material 'x' (there is none)", ""},
      {"AttributeEnd", "AttributeEnd ends nothing", ""},
      {"AttributeBegin", "AttributeBegin has no end", ""},
      {"ObjectBegin \"o\"\nTransformEnd", "TransformEnd ends ObjectBegin of scene.pbrt:2", ""},
      {"Material \"diffusetransmission\" \"rgb reflectance\" [.5 .25 .7] \"rgb transmittance\" [.5 .25 "
       ".5]\nShape \"sphere\"",
       "reflectance and transmittance of material 'diffusetransmission' add up to 1.2 in a channel, more "
       "than 1 "
       "(with --lenient both are scaled down)",
       "reflectance and transmittance of material 'diffusetransmission' add up to 1.2"},
      {"Camera \"perspective\"", "Camera stands behind WorldBegin", ""},
      {"ObjectInstance \"o\"", "unknown object 'o' (there is none)", ""},
      {"Include \"none.pbrt\"", "file 'none.pbrt': no such file", ""},
      {"Include \"scene.pbrt\"", "'scene.pbrt' includes itself", ""},
      {"Translate 1 2 \"3\"", "Translate needs a finite number, not '3'", ""},
      {"Scale 0 1 1\nShape \"sphere\"", "the transform of the shape is singular", ""},
      {"LookAt 0 0 0 0 0 1 0 0 1", "LookAt looks at its own place, or along its up vector", ""},
      {"LightSource \"goniometrik\"", "unknown light 'goniometrik' (did you mean 'goniometric'?)",
       "unknown light 'goniometrik': it is read as 'point' (did you mean 'goniometric'?)"},
      {"LightSource \"projection\"",
       "light 'projection' needs a picture (write \"string filename\" \"picture.png\")", ""},
      {"LightSource \"projection\" \"string filename\" \"image.png\" \"float fov\" 180",
       "fov 180 is not within 0 and 180", ""},
      {"Texture \"t\" \"float\" \"fbn\"\nShape \"sphere\" \"texture alpha\" \"t\"",
       "unknown texture 'fbn' (did you mean 'fbm'?)",
       "unknown texture 'fbn': it is read as the constant 0.5 (did you mean 'fbm'?)"},
      {"Texture \"t\" \"float\" \"scale\" \"texture tex\" \"t\"\nShape \"sphere\" \"texture alpha\" \"t\"",
       "the texture 't' holds itself", ""},
      {"MakeNamedMedium \"m\" \"string type\" \"clout\"", "unknown medium 'clout' (did you mean 'cloud'?)",
       "unknown medium 'clout': it is read as 'homogeneous' (did you mean 'cloud'?)"},
      {"Material \"diffuse\" \"rgb reflectance\" [2 0 0]\nShape \"sphere\"",
       "parameter 'reflectance' is 2, but must be at most 1", ""},
  };
  for (const Mistake& mistake : mistakes) {
    const auto strict = read_pbrt("WorldBegin\n" + mistake.world);
    ASSERT_FALSE(strict.ok()) << mistake.world;
    Error error = strict.error();
    EXPECT_EQ(error.file, "scene.pbrt") << mistake.world;
    EXPECT_GE(error.line, 1) << mistake.world;
    error.file.clear();
    EXPECT_EQ(error.to_string(), mistake.strict) << mistake.world;
    const auto lenient = read_pbrt("WorldBegin\n" + mistake.world, {}, {.integrator = {}, .lenient = true});
    EXPECT_EQ(lenient.ok(), !mistake.lenient.empty()) << mistake.world << " " << outcome_of(lenient);
    if (!lenient.ok() || mistake.lenient == "ok") continue;
    ASSERT_EQ(lenient->passed_over.size(), 1U) << mistake.world;
    EXPECT_TRUE(lenient->passed_over[0].text.starts_with(mistake.lenient)) << lenient->passed_over[0].text;
  }
  EXPECT_EQ(read_scene(MemorySource(Files{{"a.pbrt", "WorldBegin"}}), "a.pbrt", {{"spp", "4"}}, {})
                .error()
                .to_string(),
            "a.pbrt: the scene does not use the parameter 'spp' (a pbrt scene has none)");
}

// The outcome, and the warnings that every command tells.
std::string pbrt_warnings_of(const std::string& text, const Files& files = {}) {
  const auto read = read_pbrt(text, files);
  if (!read.ok()) return outcome_of(read);
  std::string all;
  for (const Note& note : read->passed_over)
    all += fmt::format("{}:{}: {}\n", note.where.file, note.where.line, note.text);
  return all;
}

// Claim: of two values of a parameter the last one counts, whatever their types, with a warning.
TEST(DescriptionPbrt, TheLastOfTwoValuesCounts) {
  const auto read = read_pbrt(
      "Integrator \"path\" \"integer maxdepth\" 1\n\"integer maxdepth\" 5\nWorldBegin\nMaterial \"diffuse\" "
      "\"spectrum reflectance\" [300 1 900 1] \"rgb reflectance\" [.1 .2 .3]\nShape \"sphere\"");
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  const Object& scene = *read->description.scene;
  EXPECT_EQ(scene.children_of("integrator").at(0)->get_integer("max_depth", 0), 6);
  const ObjectPtr bsdf =
      scene.children_of("shape").at(0)->children_of("bsdf").at(0)->children_of("bsdf").at(0);
  EXPECT_EQ(bsdf->get_rgb("reflectance")->value, (Vec3{0.1, 0.2, 0.3}));
  EXPECT_EQ(pbrt_warnings_of("WorldBegin\nShape \"sphere\" \"float radius\" 1\n\"float radius\" 2"),
            "scene.pbrt:3: parameter 'radius' is given twice: the last value counts\n");
}

// Claim: a directive may begin in an included file and go on in the file that includes it; where a loader
// reads it again in its own file, that is an error that names the parameter.
TEST(DescriptionPbrt, DirectivesGoOnBehindTheEndOfAFile) {
  const std::string use =
      "\n\"rgb sigma_a\" [1 1 1] \"rgb sigma_s\" [3 3 3]\nMediumInterface \"fog\" \"\"\nMaterial "
      "\"interface\"\n"
      "Shape \"sphere\"";
  const std::string begin = "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\"";
  const auto split = read_pbrt("WorldBegin\nInclude \"fog.pbrt\"" + use, {{"fog.pbrt", begin}});
  ASSERT_TRUE(split.ok()) << outcome_of(split);
  EXPECT_EQ(world_of(*split->description.scene), pbrt_world(begin + use));
  // Within a list of values and between the numbers of a directive; the file is included once more behind it.
  const auto deep = read_pbrt(
      "WorldBegin\nInclude \"a.pbrt\" 2 3\nInclude \"a.pbrt\" 0 0\nInclude \"b.pbrt\" 2 ]\nShape "
      "\"cylinder\"",
      {{"a.pbrt", "Translate 1"}, {"b.pbrt", "Attribute \"shape\" \"float radius\" ["}});
  ASSERT_TRUE(deep.ok()) << outcome_of(deep);
  EXPECT_EQ(world_of(*deep->description.scene),
            pbrt_world("Translate 2 2 3\nShape \"cylinder\" \"float radius\" 2"));
  // An error behind the end is named in the file where it stands.
  EXPECT_EQ(outcome_of(read_pbrt("WorldBegin\nInclude \"a.pbrt\"\n2 x", {{"a.pbrt", "Translate 1"}})),
            "scene.pbrt:3: Translate needs a finite number, not 'x'");
  EXPECT_EQ(outcome_of(read_pbrt("WorldBegin\nImport \"a.pbrt\"\n2 3", {{"a.pbrt", "Translate 1"}})),
            "a.pbrt:1: Translate needs a finite number");
  const std::string grid = "MakeNamedMedium \"g\" \"string type\" \"uniformgrid\" \"integer nx\" 2";
  const std::string rest = "\n\"rgb sigma_a\" [1 1 1]\nMediumInterface \"g\" \"\"\nShape \"sphere\"";
  EXPECT_EQ(outcome_of(read_pbrt("WorldBegin\nInclude \"g.pbrt\"" + rest,
                                 {{"g.pbrt", grid + " \"float density\" [1 2]"}})),
            "ok");
  EXPECT_EQ(
      outcome_of(
          read_pbrt("WorldBegin\nInclude \"g.pbrt\"\n\"float density\" [1 2]" + rest, {{"g.pbrt", grid}})),
      "scene.pbrt:3: parameter 'density' of the medium at g.pbrt:1 stands behind the end of its file (write "
      "the grid into one file)");
  EXPECT_EQ(
      outcome_of(read_pbrt("WorldBegin\nInclude \"m.pbrt\"\n\"integer indices\" [0 1 2]",
                           {{"m.pbrt", "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]"}})),
      "scene.pbrt:3: parameter 'indices' of the shape at m.pbrt:1 stands behind the end of its file (write "
      "the parameters of a mesh into one file)");
}

// Claim: an option has a name and a value without a type.
TEST(DescriptionPbrt, OptionsHaveNoType) {
  EXPECT_EQ(
      pbrt_warnings_of(
          "Option \"disablepixeljitter\" false\nOption \"seed\" 3\nOption \"rendercoordsys\" \"world\"\n"
          "Option \"disable-wavelength-jitter\" true\nWorldBegin"),
      "");
  EXPECT_EQ(pbrt_warnings_of("Option \"sead\" 3\nWorldBegin"),
            "scene.pbrt:1: unknown option 'sead' (did you mean 'seed'?)");
  const auto read = read_pbrt("Option \"forcediffuse\" true\nWorldBegin");
  ASSERT_TRUE(read.ok());
  ASSERT_EQ(read->description.notes.size(), 1U);
  EXPECT_TRUE(read->description.notes[0].text.starts_with("the option 'forcediffuse' is passed over"));
}

// Claim: the time between the opening and the closing of the camera's shutter exposes the film; a film has no
// time of its own.
TEST(DescriptionPbrt, TheShutterExposes) {
  const auto radiance = [](const std::string& camera) {
    const auto read =
        read_pbrt("Camera \"perspective\" " + camera + "\nWorldBegin\nLightSource \"infinite\"");
    return read.ok()
               ? fmt::format(
                     "{}",
                     read->description.scene->children_of("emitter").at(0)->get_rgb("radiance")->value[0])
               : outcome_of(read);
  };
  EXPECT_EQ(radiance(""), "1");
  EXPECT_EQ(radiance("\"float shutteropen\" 0.5 \"float shutterclose\" 0.75"), "0.25");
  EXPECT_EQ(radiance("\"float shutterclose\" 4"), "4");
  EXPECT_EQ(radiance("\"float shutteropen\" 2"),
            "scene.pbrt:1: the camera's shutter does not open: it closes at 1 and opens at 2");
  EXPECT_EQ(outcome_of(read_pbrt("Film \"rgb\" \"float exposuretime\" 2\nWorldBegin")).substr(0, 62),
            "scene.pbrt:1: film 'rgb' has no parameter 'exposuretime' (it h");
}

// Claim: a parameter that pbrt's integrator does not have is an error; those that it has are read.
TEST(DescriptionPbrt, ParametersOfIntegratorsAreKnown) {
  EXPECT_EQ(outcome_of(read_pbrt("Integrator \"path\" \"integer maxdept\" 3\nWorldBegin")),
            "scene.pbrt:1: integrator 'path' has no parameter 'maxdept' (did you mean 'maxdepth'?)");
  EXPECT_EQ(outcome_of(read_pbrt("Integrator \"sppm\" \"integer chains\" 3\nWorldBegin")).substr(0, 60),
            "scene.pbrt:1: integrator 'sppm' has no parameter 'chains' (i");
  for (const char* known :
       {"\"volpath\" \"string lightsampler\" \"power\" \"bool regularize\" false",
        "\"bdpt\" \"bool visualizestrategies\" false \"bool visualizeweights\" false",
        "\"mlt\" \"integer bootstrapsamples\" 10 \"integer chains\" 2 \"integer mutationsperpixel\" 3 "
        "\"float sigma\" "
        ".01 \"float largestepprobability\" .3",
        "\"sppm\" \"integer photonsperiteration\" 10 \"float radius\" 1 \"integer seed\" 3",
        "\"simplepath\" \"bool samplelights\" true \"bool samplebsdf\" true",
        "\"ambientocclusion\" \"bool cossample\" true \"float maxdistance\" 3"})
    EXPECT_EQ(outcome_of(read_pbrt(fmt::format("Integrator {}\nWorldBegin", known))), "ok") << known;
  // Another integrator than the scene's asks for nothing of it, as in XML.
  EXPECT_EQ(outcome_of(read_pbrt("Integrator \"path\" \"integer maxdept\" 3\nWorldBegin", {},
                                 {.integrator = "path", .lenient = false})),
            "ok");
}

// Claim: values that pbrt passes over are passed over with a warning.
TEST(DescriptionPbrt, ValuesThatPbrtPassesOver) {
  EXPECT_EQ(pbrt_warnings_of("Camera \"perspective\" \"float screenwindow\" [-1 1]\nWorldBegin"),
            "scene.pbrt:1: 'screenwindow' has 2 numbers, not four: it is passed over, as in pbrt\n");
  const auto light = [](const std::string& values) {
    const auto read = read_pbrt("WorldBegin\nLightSource \"infinite\" \"blackbody L\" " + values);
    return read.ok() ? read->description.scene->children_of("emitter").at(0)->get_rgb("radiance")->value
                     : Vec3{};
  };
  EXPECT_EQ(light("[3000 7]"), light("3000"));
  EXPECT_GT(light("3000")[0], 0);
  EXPECT_EQ(
      pbrt_warnings_of("WorldBegin\nLightSource \"infinite\" \"blackbody L\" [3000 7]"),
      "scene.pbrt:2: parameter 'L' has 2 values: the first is the temperature, and the others are passed "
      "over, as in pbrt\n");
}

// Claim: a scene may have more than 10,000 includes.
TEST(DescriptionPbrt, ManyIncludes) {
  std::string many = "WorldBegin\n";
  for (int i = 0; i < 10'100; ++i) many += "Include \"a.pbrt\"\n";
  EXPECT_EQ(outcome_of(read_pbrt(many, {{"a.pbrt", "# nothing\n"}})), "ok");
}

// Claim: without a PixelFilter nothing is told of one.
TEST(DescriptionPbrt, ScenesWithoutAFilterAreNotWarned) {
  const auto told = [](const std::string& filter) {
    const auto read = read_pbrt(filter + "WorldBegin");
    return read.ok() ? read->description.notes.size() : 99U;
  };
  EXPECT_EQ(told(""), 0U);
  EXPECT_EQ(told("PixelFilter \"gaussian\" \"float xradius\" 2 \"float yradius\" 2\n"), 0U);
  EXPECT_EQ(told("PixelFilter \"gaussian\"\n"), 1U);
}

// Claim: a scene without WorldBegin, such as a file that was cut off, is an error, as for pbrt.
TEST(DescriptionPbrt, AWorldMustBegin) {
  for (const char* text : {"", "Camera \"perspective\"\n"}) {
    EXPECT_EQ(outcome_of(read_pbrt(text)),
              "scene.pbrt: the scene has no WorldBegin (with --lenient its world is empty)");
    const auto lenient = read_pbrt(text, {}, {.integrator = {}, .lenient = true});
    ASSERT_TRUE(lenient.ok()) << outcome_of(lenient);
    ASSERT_EQ(lenient->passed_over.size(), 1U);
    EXPECT_EQ(lenient->passed_over[0].text, "the scene has no WorldBegin: its world is empty");
  }
}

}  // namespace
}  // namespace candela::description
