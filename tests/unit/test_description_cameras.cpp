// Claims: cameras, filters and spot lights of 0.6 mean what today's spelling says, and what they do not have
// is refused by name.
#include <gtest/gtest.h>

#include <string>

#include "tests/unit/test_description_common.h"

namespace candela::description {
namespace {

TEST(DescriptionCameras, OldSpellingEqualsNew) {
  const auto old_spelling = parse_text(R"(<scene version="0.6.0">
    <sensor type="thinlens"><float name="apertureRadius" value="0.1"/><float name="focusDistance" value="3"/>
      <float name="fov" value="40"/><film type="hdrfilm"><rfilter type="mitchell"><float name="B" value="0.25"/>
      <float name="C" value="0.5"/></rfilter></film></sensor>
    <emitter type="spot"><rgb name="intensity" value="3"/><float name="cutoffAngle" value="30"/>
      <float name="beamWidth" value="10"/></emitter></scene>)");
  const auto new_spelling = parse_text(R"(<scene version="3.0.0">
    <sensor type="thinlens"><float name="aperture_radius" value="0.1"/><float name="focus_distance" value="3"/>
      <float name="fov" value="40"/><film type="hdrfilm"><rfilter type="mitchell"><float name="B" value="0.25"/>
      <float name="C" value="0.5"/></rfilter></film></sensor>
    <emitter type="spot"><rgb name="intensity" value="3"/><float name="cutoff_angle" value="30"/>
      <float name="beam_width" value="10"/></emitter></scene>)");
  ASSERT_TRUE(old_spelling.ok()) << outcome(old_spelling);
  ASSERT_TRUE(new_spelling.ok()) << outcome(new_spelling);
  EXPECT_EQ(dump(*old_spelling->scene), dump(*new_spelling->scene));
}

TEST(DescriptionCameras, RefuseByName) {
  const auto error = [](const std::string& inner) {
    return outcome(parse_text("<scene version=\"3.0.0\">\n" + inner + "</scene>"));
  };
  const auto names = [&](const std::string& inner, const std::string& name) {
    EXPECT_NE(error(inner).find(name), std::string::npos) << error(inner);
  };
  names("<sensor type=\"thinlens\"/>", "aperture_radius");
  names("<sensor type=\"orthographic\"><float name=\"fov\" value=\"40\"/></sensor>", "fov");
  names("<emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"200\"/></emitter>", "cutoff_angle");
  const auto filter = [](const std::string& text) {
    return "<sensor type=\"perspective\"><film type=\"hdrfilm\">" + text + "</film></sensor>";
  };
  names(filter("<rfilter type=\"mitchell\"><float name=\"A\" value=\"0.3\"/></rfilter>"), "A");
  names(filter("<rfilter type=\"lanczos\"><integer name=\"lobes\" value=\"0\"/></rfilter>"), "lobes");
  names(filter("<rfilter type=\"catmullrom\"><float name=\"radius\" value=\"1\"/></rfilter>"), "radius");
}

// Claim: an irradiance meter leaves the shape that it is in and refers to it; its film, and that of a distant
// sensor, is filtered by a box; a meter without a shape, or in two, and a sensor with two targets are errors.
TEST(DescriptionCameras, MetersReferToTheirShapes) {
  for (const std::string version : {"3.0.0", "0.6.0"}) {
    const auto read = parse_text("<scene version='" + version +
                                 "'><shape type='sphere' id='ball'><sensor type='irradiancemeter'><film "
                                 "type='hdrfilm'><integer name='width' value='3'/><rfilter type='gaussian'/>"
                                 "</film></sensor></shape></scene>");
    ASSERT_TRUE(read.ok()) << outcome(read);
    const auto shapes = read->scene->children_of("shape"), sensors = read->scene->children_of("sensor");
    ASSERT_EQ(shapes.size(), 1u);
    ASSERT_EQ(sensors.size(), 1u);
    EXPECT_TRUE(shapes[0]->children_of("sensor").empty());
    ASSERT_EQ(sensors[0]->children_of("shape").size(), 1u);
    EXPECT_EQ(sensors[0]->children_of("shape")[0], shapes[0]);
    ASSERT_EQ(sensors[0]->children_of("film").size(), 1u);
    const ObjectPtr film = sensors[0]->children_of("film")[0];
    EXPECT_EQ(film->get_integer("width", 0), 3);
    ASSERT_EQ(film->children_of("rfilter").size(), 1u);
    EXPECT_EQ(film->children_of("rfilter")[0]->plugin, "box");
  }
  const auto error = [](const std::string& inner) {
    return outcome(parse_text("<scene version=\"3.0.0\">\n" + inner + "</scene>"));
  };
  EXPECT_NE(error("<sensor type='irradiancemeter'/>").find("is in no shape"), std::string::npos);
  EXPECT_NE(error("<sensor type='irradiancemeter' id='m'/>").find("is in no shape"), std::string::npos);
  EXPECT_NE(error("<shape type='cube'><sensor type='irradiancemeter' id='m'/></shape><shape type='cube'><ref "
                  "id='m'/></shape>")
                .find("is in two shapes"),
            std::string::npos);
  EXPECT_NE(error("<shape type='cube'><sensor type='irradiancemeter'><transform name='to_world'/></sensor>"
                  "</shape>")
                .find("to_world"),
            std::string::npos);
  EXPECT_NE(error("<sensor type='distant'><point name='target' value='1 2 3'/><shape type='disk'/></sensor>")
                .find("two targets"),
            std::string::npos);
}

}  // namespace
}  // namespace candela::description
