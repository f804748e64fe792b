// Malformed scenes: each gives exactly this message.
#include <gtest/gtest.h>

#include "common/description/all_errors.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

struct Case {
  std::string body;      // inside <scene>, on its second line; or a whole file where it starts with '!'
  std::string expected;  // the message
  std::map<std::string, std::string> parameters = {};
  std::map<std::string, std::string> files = {};
};

std::string file_of(const std::string& body) {
  if (body.starts_with('!')) return body.substr(1);
  return "<scene version=\"3.0.0\">\n" + body + "\n</scene>";
}

std::string repeat(const std::string& text, int times) {
  std::string result;
  for (int i = 0; i < times; ++i) result += text;
  return result;
}

std::vector<Case> cases() {
  const std::string shape = "<shape type='sphere'>";
  const std::string end = "</shape>";
  return {
#include "test_description_errors.inc"
  };
}

// Claim: bad input of each kind gives one error that names file, line, and the mend where there is one.
TEST(DescriptionErrors, Table) {
  for (const Case& test : cases()) {
    const auto result = parse_text(file_of(test.body), test.parameters, test.files);
    EXPECT_EQ(outcome(result), test.expected) << "for " << test.body.substr(0, 200);
  }
}

// Claim: what Mitsuba has and Candela lacks is refused by name, with what there is instead.
TEST(DescriptionErrors, RefusedByName) {
  for (const auto& [body, start] :
       {std::pair{"<bsdf type='irawan'/>",
                  "scene.xml:2: bsdf 'irawan' is not supported yet (there is 'diffuse'"},
        std::pair{"<shape type='zzzzzzzz'/>", "scene.xml:2: unknown shape 'zzzzzzzz' (there is 'obj'"},
        std::pair{"<shape type='hair'/>",
                  "scene.xml:2: shape 'hair' is not supported yet (there is 'obj'"}}) {
    const std::string text = outcome(parse_text(file_of(body), {}, {}));
    EXPECT_TRUE(text.starts_with(start)) << text;
  }
}

std::vector<std::string> errors_of(const std::string& xml, std::map<std::string, std::string> more = {}) {
  more["scene.xml"] = xml;
  std::vector<std::string> texts;
  for (const Error& error : all_errors(MemorySource(std::move(more)), "scene.xml", {}, {}))
    texts.push_back(error.to_string());
  return texts;
}

// Claim: all errors of elements that do not depend on each other are found, in the order of the file, then
// those of references; none follows from another one.
TEST(DescriptionErrors, AllAreFound) {
  EXPECT_EQ(errors_of(R"(<scene version="3.0.0">
<bsdf type="difuse" id="a"/>
<shape type="sphere"><ref id="a"/></shape>
<bsdf type="twosided" id="b"><bsdf type="plastik"/></bsdf>
<shape type="sphere"><float name="radius" value="x"/>
<float name="radiu" value="1"/></shape>
<shape type="sphere"><float name="radius" value="-1"/>
<float name="radiu" value="1"/></shape>
<include filename="more.xml"/>
<include filename="more.xml"/>
<shape type="obj"><string name="filename" value="none.obj"/></shape>
<shape type="obj"/>
<shape type="cube"><ref id="b"/><ref id="c"/></shape>
<colour/>
</scene>)",
                      {{"more.xml", "<scene version='3.0.0'>\n<shape type='qube'/></scene>"}}),
            (std::vector<std::string>{
                "scene.xml:2: unknown bsdf 'difuse' (did you mean 'diffuse'?)",
                "scene.xml:4: unknown bsdf 'plastik' (did you mean 'plastic'?)",
                "scene.xml:5: 'x' in <float> is not a finite number",
                "scene.xml:7: parameter 'radius' is -1, but must be above 0",
                "scene.xml:8: shape 'sphere' has no parameter 'radiu' (did you mean 'radius'?)",
                "more.xml:2: unknown shape 'qube' (did you mean 'cube'?)",
                "more.xml:2: unknown shape 'qube' (did you mean 'cube'?)",
                "scene.xml:11: file 'none.obj': no such file",
                "scene.xml:14: unknown element <colour>",
                "scene.xml:12: shape 'obj' lacks the parameter 'filename'",
                "scene.xml:13: no object has the id 'c'",
            }));
  EXPECT_EQ(errors_of("<scene version='3.0.0'/>"), std::vector<std::string>());
  EXPECT_EQ(errors_of("<scene").size(), 1U);
}

// Claim: the errors end at their bound, and the first is the one that a reading gives.
TEST(DescriptionErrors, AllAreBounded) {
  const std::string xml = file_of(repeat("<shape type='qube'/>\n", 100));
  const std::vector<std::string> all = errors_of(xml);
  ASSERT_EQ(all.size(), kMaxErrors);
  EXPECT_EQ(all.front(), outcome(parse_text(xml)));
  EXPECT_TRUE(all.back().starts_with("scene.xml:21: ")) << all.back();
  // A circle does not hang, nor does a scene that is too deep.
  EXPECT_EQ(errors_of(file_of("<bsdf type='mask' id='a'><ref id='b'/></bsdf><bsdf type='mask' id='b'>"
                              "<ref id='a'/></bsdf>"))
                .size(),
            1U);
  EXPECT_GE(errors_of(file_of(repeat("<bsdf type='twosided'>", 70) + repeat("</bsdf>", 70))).size(), 1U);
}

// Claim: which files are of 0.6 is known without reading them whole.
TEST(DescriptionErrors, OldScenesAreKnown) {
  const auto old = [](const std::string& text) {
    return is_old_scene(MemorySource({{"scene.xml", text}}), "scene.xml");
  };
  EXPECT_TRUE(old("<scene version='0.6.0'><nonsense/></scene>"));
  EXPECT_TRUE(old("<scene version='1.2'/>"));
  for (const char* text :
       {"<scene version='2.0.0'/>", "<scene version='3.0.0'/>", "<scene/>", "<scene version='x'/>", "<sc"})
    EXPECT_FALSE(old(text)) << text;
}

// Claim: includes that double at every level end at the bounds, quickly.
TEST(DescriptionErrors, ExplodingIncludesEnd) {
  std::map<std::string, std::string> files;
  for (int level = 0; level < 40; ++level) {
    const std::string next = "<include filename='" + std::to_string(level + 1) + ".xml'/>";
    files[std::to_string(level) + ".xml"] = "<scene>" + next + next + "</scene>";
  }
  files["40.xml"] = "<scene/>";
  const auto result = parse_text("<scene version='3.0.0'><include filename='0.xml'/></scene>", {}, files);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().message, "the scene has more than 10000 includes");
}

// Claim: includes nested without end, each a new file, stop at the bound.
TEST(DescriptionErrors, DeepIncludesEnd) {
  std::map<std::string, std::string> files;
  for (int level = 0; level < 100; ++level)
    files[std::to_string(level) + ".xml"] =
        "<scene><include filename='" + std::to_string(level + 1) + ".xml'/></scene>";
  files["100.xml"] = "<scene/>";
  EXPECT_EQ(outcome(parse_text("<scene version='3.0.0'><include filename='0.xml'/></scene>", {}, files)),
            "63.xml:1: includes are nested deeper than 64 levels");
}

// Claim: huge flat input is linear work: a scene of 200 000 shapes parses.
TEST(DescriptionErrors, ManyShapesAreFine) {
  const auto result =
      parse_text("<scene version='3.0.0'>" + repeat("<shape type='cube'/>", 200000) + "</scene>");
  ASSERT_TRUE(result.ok()) << outcome(result);
  EXPECT_EQ(result->scene->children.size(), 200000U);
}

// Claim: <default>s that double each other, and then are used again and again, end at the bounds.
TEST(DescriptionErrors, ExplodingDefaultsEnd) {
  std::string body = "<default name='a0' value='0123456789'/>";
  for (int i = 1; i < 64; ++i) {
    const std::string last = "$a" + std::to_string(i - 1) + "_";
    body += "<default name='a" + std::to_string(i - 1) + "_' value='$a" + std::to_string(i - 1) + "'/>";
    body += "<default name='a" + std::to_string(i) + "' value='" + last + last + "'/>";
  }
  EXPECT_EQ(outcome(parse_text("<scene version='3.0.0'>" + body + "</scene>")),
            "scene.xml:1: an attribute grows beyond 16777216 bytes by its parameters");
  const std::string wide = "<default name='w' value='" + std::string(1 << 20, 'x') + "'/>" +
                           repeat("<default name='u' value='$w'/>", 1000);
  EXPECT_EQ(outcome(parse_text("<scene version='3.0.0'>" + wide + "</scene>")),
            "scene.xml:1: the scene's attributes grow by more than 268435456 bytes by their parameters");
}

// Claim: the longest known name counts, whatever other names lie between its letters; each use looks at few
// names only (fifty thousand of them, used as often, are no matter of minutes).
TEST(DescriptionErrors, ManyParameters) {
  std::string body;
  for (int i = 0; i < 50'000; ++i)
    body += "<default name='p" + std::to_string(i) + "' value='" + std::to_string(i) + "'/>";
  for (int i = 0; i < 50'000; ++i) body += "<default name='q' value='$p" + std::to_string(i) + "'/>";
  EXPECT_EQ(outcome(parse_text("<scene version='3.0.0'>" + body + "</scene>")), "ok");
  const auto name_of = [](const std::string& defaults, const std::string& use) {
    const auto result =
        parse_text("<scene version='3.0.0'>" + defaults + "<bsdf type='diffuse' id='" + use + "'/></scene>");
    return result.ok() ? result->scene->children.at(0).object->id : outcome(result);
  };
  const std::string names =
      "<default name='a' value='1'/><default name='ab' value='2'/><default name='abd' value='3'/>"
      "<default name='abcc' value='4'/><default name='ac' value='5'/>";
  EXPECT_EQ(name_of(names, "$abcd"), "2cd");
  EXPECT_EQ(name_of(names, "$abdx$ac$aa$abcb$abcc"), "3x51a2cb4");
  EXPECT_EQ(name_of(names, "$b"),
            "scene.xml:1: the parameter '$b' has no value (give it one with -D b=..., or by a "
            "<default> before this line)");
}

// Claim: elements nested without end, and one attribute of many megabytes, are an error or are read.
TEST(DescriptionErrors, DeepAndHuge) {
  EXPECT_EQ(outcome(parse_text("<scene version='3.0.0'>" + repeat("<bsdf type='twosided'>", 200'000) +
                               repeat("</bsdf>", 200'000) + "</scene>")),
            "scene.xml:1: elements are nested deeper than 64 levels");
  std::string list;
  for (int i = 0; i < 500'000; ++i) list += std::to_string(300 + i) + ":0.5,";
  EXPECT_EQ(
      outcome(parse_text("<scene version='3.0.0'><bsdf type='diffuse'><spectrum name='reflectance' value='" +
                         list + "'/></bsdf></scene>")),
      "ok");
  EXPECT_EQ(
      outcome(parse_text("<scene version='3.0.0'><bsdf type='" + std::string(8 << 20, 'x') + "'/></scene>"))
          .substr(0, 32),
      "scene.xml:1: unknown bsdf 'xxxxx");
}

}  // namespace
}  // namespace candela::description
