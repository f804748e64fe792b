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

}  // namespace
}  // namespace candela::description
