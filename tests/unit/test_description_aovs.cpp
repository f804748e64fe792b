// The layers that a scene asks for by Mitsuba 3's integrator `aov`.
#include <gtest/gtest.h>

#include "common/description/reading.h"
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

}  // namespace
}  // namespace candela::description
