// Scenes of other renderers: integrators that do not run here, unknown parameters and elements.
#include <gtest/gtest.h>

#include "common/description/reading.h"
#include "common/description/setting_text.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

const std::string new_file = "3.0.0", old_file = "0.6.0";

Result<ReadScene> read(const std::string& version, const std::string& body, const Reading& reading,
                       const std::map<std::string, std::string>& given = {},
                       std::map<std::string, std::string> files = {}) {
  files["scene.xml"] = "<scene version='" + version + "'>\n" + body + "\n</scene>";
  files["image.png"] = "not read here";
  return read_scene(MemorySource(std::move(files)), "scene.xml", given, reading);
}

// The error, or what was passed over, a line each.
std::string told(const Result<ReadScene>& result) {
  if (!result.ok()) return result.error().to_string();
  std::string text;
  for (const Note& note : result->passed_over)
    text += note.where.file + ":" + std::to_string(note.where.line) + ": " + note.text + "\n";
  return text;
}

// "type name=value ..." of the scene's integrator.
std::string integrator_of(const Result<ReadScene>& result) {
  if (!result.ok()) return result.error().to_string();
  const auto all = result->description.scene->children_of("integrator");
  if (all.size() != 1) return std::to_string(all.size()) + " integrators";
  std::string text = all[0]->plugin;
  for (const Property& property : all[0]->properties)
    text += " " + property.name + "=" + setting_text(property).value_or("?");
  return text;
}

const Reading kStrict;
const Reading kWithPath{.integrator = "path"};
const Reading kLenient{.lenient = true};

// Claim: where another integrator runs, the scene's may be of any type, hold anything, and be given twice;
// what the one that runs knows is taken over, also from integrators inside, the outermost value first.
TEST(DescriptionReading, AnyIntegratorPasses) {
  const struct {
    const char* body;
    const char* expected;
    const char* version = "3.0.0";
  } cases[] = {
      {"<integrator type='guided_path'><integer name='maxDepth' value='5'/><string name='mode' value='x'/>"
       "<boolean name='hide_emitters' value='true'/></integrator>",
       "guided_path hide_emitters=true"},
      {"<integrator type='guided_path'><integer name='maxDepth' value='5'/></integrator>",
       "guided_path max_depth=5", "0.6.0"},
      {"<integrator type='moment'><integrator type='path' name='a'><integer name='max_depth' value='7'/>"
       "<integer name='rr_depth' value='3'/></integrator><integrator type='x'><integer name='max_depth' "
       "value='9'/></integrator></integrator>",
       "moment max_depth=7 rr_depth=3"},
      {"<integrator type='aov'><sampler type='none'><integer name='max_depth' value='5'/></sampler>"
       "<odd><integer name='max_depth' value='6'/></odd>text<ref id='nothing'/></integrator>",
       "aov"},
      {"<integrator><integer name='max_depth' value='5'/></integrator>", " max_depth=5"},
      {"<integrator type='guided'><integer name='max_depth' value='many'/><float name='rr_depth' value='2'/>"
       "<integer name='max_depth' value='-9'/><integer value='2'/></integrator>",
       "guided"},
      {"<integrator type='$kind'><string name='$name' value='$value'/></integrator>", "$kind"},
      {"<integrator type='vcm'><integer name='max_depth' value='4'/><float name='alpha' value='0.5'/>"
       "<boolean name='odd' value='true'/></integrator>",
       "vcm max_depth=4"},
      {"<integrator type='direct'/><integrator type='path'><integer name='max_depth' "
       "value='2'/></integrator>",
       "direct"},
      {"<include filename='other.xml'/>", "irrcache max_depth=3"},
  };
  for (const auto& test : cases) {
    const auto result = read(
        test.version, test.body, kWithPath, {},
        {{"other.xml", "<integrator type='irrcache'><integer name='max_depth' value='3'/></integrator>"}});
    EXPECT_EQ(integrator_of(result), test.expected) << test.body;
    EXPECT_EQ(told(result), "") << test.body;
  }
  EXPECT_EQ(told(read(new_file, cases[0].body, kStrict)),
            "scene.xml:2: unknown integrator 'guided_path' (there is 'path', 'light', 'bdpt', 'ppm', 'bpm', "
            "'vcm', 'upbp', 'optimis', 'fppm', 'cppm', 'appm', 'vcmplus', 'mcppm', 'pssmlt', 'mmlt', 'mlt', "
            "'erpt'; --integrator NAME chooses one)");
}

// Claim: a scene's integrator that is the one that runs tells what of it is passed over.
TEST(DescriptionReading, OwnIntegratorTellsWhatIsPassedOver) {
  const auto result = read(new_file,
                           "<integrator type='volpath'><integer name='max_depth' value='7'/>\n"
                           "<integer name='maxdepth' value='8'/><boolean name='strict_normals' value='true'/>"
                           "<integer name='block_size' value='32'/></integrator>",
                           kWithPath);
  EXPECT_EQ(integrator_of(result), "path max_depth=7 strict_normals=true block_size=32");
  EXPECT_EQ(told(result),
            "scene.xml:3: integrator 'path' has no parameter 'maxdepth': it is passed over (did you mean "
            "'max_depth'?)\n");
}

// Claim: a parameter that the scene's integrator has, and that has an effect here, keeps its checks.
TEST(DescriptionReading, UsedParametersOfIntegratorsStayChecked) {
  for (const std::string type : {"path", "bdpt"}) {
    EXPECT_EQ(told(read(new_file,
                        "<integrator type='" + type + "'><integer name='max_depth' value='-2'/></integrator>",
                        kWithPath)),
              "scene.xml:2: parameter 'max_depth' is -2, but must be at least -1");
    EXPECT_EQ(told(read(new_file,
                        "<integrator type='" + type + "'><integer name='max_depth' value='x'/></integrator>",
                        kWithPath)),
              "scene.xml:2: 'x' is not an integer");
  }
}

// Claim: $parameters that only the passed over element uses count as used, and need no value.
TEST(DescriptionReading, ParametersInOtherIntegratorsAreUsed) {
  const std::string body =
      "<integrator type='aov'><string name='aovs' value='$aovs'/><odd value='$odd'/><x "
      "y='$none'/></integrator>";
  EXPECT_EQ(told(read(new_file, body, kWithPath, {{"aovs", "dd.y:depth"}, {"odd", "1"}})), "");
}

// Claim: a <default> inside of the element counts for the rest of the scene, as it does elsewhere.
TEST(DescriptionReading, DefaultsInOtherIntegratorsCount) {
  const std::string body =
      "<integrator type='aov'><default name='r' value='2'/></integrator>"
      "<shape type='sphere'><float name='radius' value='$r'/></shape>";
  EXPECT_EQ(told(read(new_file, body, kWithPath)), "");
}

// Claim: integrators nested without end stop at the bound.
TEST(DescriptionReading, DeepIntegratorsEnd) {
  std::string body;
  for (int i = 0; i < 100'000; ++i) body += "<integrator type='x'>";
  for (int i = 0; i < 100'000; ++i) body += "</integrator>";
  EXPECT_EQ(told(read(new_file, body, kWithPath)), "scene.xml:2: elements are nested deeper than 64 levels");
}

// Claim: an unknown parameter is an error in a file of version 2 or later, and passed over with the nearest
// name in an older one, as Mitsuba 0.6 does; --lenient passes it over everywhere.
TEST(DescriptionReading, UnknownParameters) {
  const std::string body =
      "<shape type='sphere'><float name='radios' value='2'/><bsdf type='dielectric'>\n"
      "<boolean name='usePathGuiding' value='true'/><rgb name='color' value='1'/></bsdf></shape>";
  const std::string radius =
      "scene.xml:2: shape 'sphere' has no parameter 'radios': it is passed over (did you mean 'radius'?)\n";
  const std::string rest = "'int_ior', 'ext_ior', 'specular_reflectance', 'specular_transmittance'";
  EXPECT_EQ(told(read(old_file, body, kStrict)),
            "scene.xml:3: bsdf 'dielectric' has no parameter 'use_path_guiding': it is passed over (it has " +
                rest +
                ")\nscene.xml:3: bsdf 'dielectric' has no parameter 'color': it is passed over (it has " +
                rest + ")\n" + radius);
  EXPECT_EQ(told(read(new_file, body, kStrict)),
            "scene.xml:3: bsdf 'dielectric' has no parameter 'usePathGuiding' (it has " + rest + ")");
  const auto passed = read(new_file, body, kLenient);
  EXPECT_NE(told(passed).find("'usePathGuiding': it is passed over (it has"), std::string::npos);
  EXPECT_NE(told(passed).find(radius), std::string::npos);
  ASSERT_TRUE(passed.ok());
  // They are notes of the scene, and gone from its objects.
  EXPECT_EQ(passed->description.notes.size(), 3U);
  EXPECT_TRUE(passed->description.scene->children.at(0).object->properties.empty());
}

// Claim: what is required and absent stays an error, however lenient the reading is; a value out of bounds
// does not.
TEST(DescriptionReading, KnownParametersStayChecked) {
  for (const std::string& version : {new_file, old_file}) {
    EXPECT_EQ(told(read(version, "<shape type='sphere'><float name='radius' value='-1'/></shape>", kLenient)),
              "scene.xml:2: parameter 'radius' is -1, but must be above 0: 1e-06 is taken\n");
    EXPECT_EQ(told(read(version, "<shape type='obj'><string name='file' value='a.obj'/></shape>", kLenient)),
              "scene.xml:2: shape 'obj' lacks the parameter 'filename'");
  }
}

// Claim: what Mitsuba 0.6 heeds and Candela lacks is not passed over in a file of 0.6 as if 0.6 did not know
// it.
TEST(DescriptionReading, HeededParametersStayErrors) {
  const auto medium =
      read(old_file, "<medium type='heterogeneous'><vector name='orientation' x='0' y='0' z='1'/></medium>",
           kStrict);
  const std::string error = "scene.xml:2: medium 'heterogeneous' has no parameter 'orientation'";
  EXPECT_EQ(told(medium).substr(0, error.size()), error);
}

// Claim: --lenient passes over elements that nobody knows, with all that is in them, and textures for
// parameters that the plugin does not have; without it they are errors.
TEST(DescriptionReading, UnknownElements) {
  const std::string mode = "<shape type='cube'><mode value='1'><deep>text</deep></mode></shape>";
  EXPECT_EQ(told(read(new_file, mode, kStrict)), "scene.xml:2: <deep> cannot be inside <mode>");
  EXPECT_EQ(told(read(new_file, mode, kLenient)), "scene.xml:2: unknown element <mode>: it is passed over\n");
  EXPECT_EQ(told(read(new_file, "<shape type='cube'><vector4f name='a' value='1'/></shape>", kLenient)),
            "scene.xml:2: unknown element <vector4f>: it is passed over (did you mean 'vector'?)\n");
  const std::string texture =
      "<shape type='cube'><bsdf type='diffuse'><texture type='checkerboard' "
      "name='reflectence'/></bsdf></shape>";
  EXPECT_EQ(told(read(old_file, texture, kStrict)),
            "scene.xml:2: bsdf 'diffuse' has no parameter 'reflectence' (did you mean 'reflectance'?)");
  const auto passed = read(new_file, texture, kLenient);
  EXPECT_EQ(told(passed),
            "scene.xml:2: bsdf 'diffuse' has no parameter 'reflectence': it is passed over (did you mean "
            "'reflectance'?)\n");
  ASSERT_TRUE(passed.ok());
  EXPECT_TRUE(passed->description.scene->children.at(0).object->children.at(0).object->children.empty());
  // Known ones at a wrong place stay errors: to leave them out would be another scene.
  EXPECT_EQ(told(read(new_file, "<shape type='cube'><sampler type='independent'/></shape>", kLenient)),
            "scene.xml:2: sampler 'independent' cannot be inside shape 'cube'");
  EXPECT_EQ(told(read(new_file, "<shape type='cube'><animation name='to_world'/></shape>", kStrict)),
            "scene.xml:2: <animation> is not supported yet");
}

}  // namespace
}  // namespace candela::description
