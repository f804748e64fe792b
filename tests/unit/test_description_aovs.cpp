// The layers and edits that a scene asks for by Mitsuba 3's integrator `aov`, and by `lpe` and `edits`.
#include <gtest/gtest.h>

#include "common/description/reading.h"
#include "common/description/scene_aovs.h"
#include "common/edits/edits.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

// The list that a job gets, then what was passed over, a line each; or the error.
std::string aovs_of(const std::string& integrator, const Reading& reading) {
  const auto result =
      read_scene(MemorySource({{"scene.xml", "<scene version='3.0.0'>\n" + integrator + "\n</scene>"}}),
                 "scene.xml", {}, reading);
  if (!result.ok()) return result.error().to_string();
  std::string text = result->description.aovs;
  for (const Note& note : result->passed_over)
    text += "\n" + note.where.file + ":" + std::to_string(note.where.line) + ": " + note.text;
  return text;
}

std::string aov_element(const std::string& list) {
  return "<integrator type='aov'><string name='aovs' value='" + list +
         "'/><integrator type='path'/></integrator>";
}

// Claim: the list is read whichever integrator runs; unknown kinds are an error with their
// line, or told under --lenient and if another integrator runs than the scene's.
TEST(DescriptionAovs, AreRead) {
  const Reading strict, with_bdpt{.integrator = "bdpt"}, lenient{.lenient = true};
  for (const Reading& reading : {strict, with_bdpt, lenient}) {
    EXPECT_EQ(aovs_of(aov_element("dd.y:depth,nn:sh_normal"), reading), "dd.y:depth,nn:sh_normal");
    EXPECT_EQ(aovs_of(aov_element("a:albedo, p:position"), reading), "a:albedo,p:position");
    EXPECT_EQ(aovs_of(aov_element("a:albedo,b:boundary_test,d:duv_dx"), reading),
              "a:albedo,b:boundary_test,d:duv_dx");
    EXPECT_EQ(aovs_of(aov_element(""), reading), "");
    EXPECT_EQ(aovs_of("<integrator type='path'/>", reading), "");
  }
  EXPECT_TRUE(
      aovs_of(aov_element("a:albedo,b:colour"), strict).starts_with("scene.xml:2: there is no AOV 'colour'"))
      << aovs_of(aov_element("a:albedo,b:colour"), strict);
  for (const Reading& reading : {with_bdpt, lenient})
    EXPECT_EQ(aovs_of(aov_element("a:albedo,b:colour"), reading),
              "a:albedo\nscene.xml:2: there is no AOV 'colour': it is passed over");
  EXPECT_EQ(aovs_of(aov_element("a:albedo,a:depth"), with_bdpt),
            "a:albedo\nscene.xml:2: two AOVs are called 'a': it is passed over");
  EXPECT_EQ(aovs_of("<integrator type='aov'><integer name='aovs' value='3'/></integrator>", with_bdpt),
            "\nscene.xml:2: the parameter 'aovs' of integrator 'aov' is no string: it is passed over");
}

std::string layers_of(const std::string& integrator, const Reading& reading) {
  const auto result =
      read_scene(MemorySource({{"scene.xml", "<scene version='3.0.0'>\n" + integrator + "\n</scene>"}}),
                 "scene.xml", {}, reading);
  if (!result.ok()) return result.error().to_string();
  std::string text = result->description.layers + " | " + result->description.aovs;
  for (const ObjectPtr& object : result->description.scene->children_of("integrator"))
    text += " | " + object->plugin;
  for (const Note& note : result->passed_over) text += "\n" + note.text;
  return text;
}

// Claim: layers of expressions are read around the integrator that runs, whichever that is, and beside AOVs;
// a bad expression is an error with its line and column, under every reading.
TEST(DescriptionAovs, LayersOfExpressions) {
  const std::string layers = "<string name='layers' value='layer a=LDE;  region r=sphere:0,0,0,1'/>";
  const std::string with_path = "<integrator type='lpe'>" + layers + "<integrator type='path'/></integrator>";
  const std::string expected = "layer a=LDE; region r=sphere:0,0,0,1 | ";
  EXPECT_EQ(layers_of(with_path, {}), expected + " | path");
  EXPECT_EQ(layers_of(with_path, {.lenient = true}), expected + " | path");
  // The command line's integrator runs, whatever the element is called.
  EXPECT_TRUE(layers_of(with_path, {.integrator = "bdpt"}).starts_with(expected));
  EXPECT_EQ(
      layers_of("<integrator type='aov'><string name='aovs' value='d:depth'/>" + with_path + "</integrator>",
                {}),
      expected + "d:depth | path");
  for (const Reading& reading : {Reading{}, Reading{.lenient = true}, Reading{.integrator = "bdpt"}})
    EXPECT_EQ(layers_of("<integrator type='lpe'>\n<string name='layers' value='layer a=L(E'/><integrator "
                        "type='path'/></integrator>",
                        reading),
              "scene.xml:3: layer 'a', column 2: this '(' is not closed (write ')')");
  EXPECT_TRUE(layers_of("<integrator type='lpe'><string name='layer' value='a=LE'/><integrator "
                        "type='path'/></integrator>",
                        {})
                  .starts_with("scene.xml:2: an integrator 'lpe' has one parameter, the string 'layers'"));
}

// Claim: edits are read around the integrator that runs, whichever that is, beside layers; a fault is an
// error with its line and key.
TEST(DescriptionAovs, EditsOfLight) {
  const auto edits_of = [](const std::string& integrator, const Reading& reading) {
    const auto result =
        read_scene(MemorySource({{"scene.xml", "<scene version='3.0.0'>\n" + integrator + "\n</scene>"}}),
                   "scene.xml", {}, reading);
    if (!result.ok()) return result.error().to_string();
    return result->description.scene->get_string(kEditsOfScene, "none");
  };
  const auto around = [](const std::string& text) {
    return "<integrator type='edits'>\n<string name='edits' value='" + text +
           "'/><integrator type='lpe'><string name='layers' value='layer a=LDE'/><integrator "
           "type='path'/></integrator></integrator>";
  };
  const std::string dim =
      R"({"edits": [{"name": "dim", "direction": "light", "select": "LX*X", "scale": 0.5}]})";
  const auto list = edits::parse_edits(dim);
  for (const Reading& reading : {Reading{}, Reading{.lenient = true}, Reading{.integrator = "bdpt"}}) {
    EXPECT_EQ(edits_of(around(dim), reading), edits::text_of(*list));
    EXPECT_TRUE(layers_of(around(dim), reading).starts_with("layer a=LDE"));
    EXPECT_EQ(edits_of("<integrator type='path'/>", reading), "none");
    const std::string fault = edits_of(around(R"({"edits": [{"name": "dim", "direction": "up"}]})"), reading);
    EXPECT_TRUE(fault.starts_with("scene.xml:3: edits[0].direction: ")) << fault;
  }
  EXPECT_TRUE(edits_of("<integrator type='edits'><integrator type='path'/></integrator>", {})
                  .starts_with("scene.xml:2: an integrator 'edits' has one parameter, the string 'edits'"));
}

}  // namespace
}  // namespace candela::description
