// Meaning of a well-formed scene: values, references, includes, parameters, transforms, the old spelling,
// real scenes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>

#include "common/bundle/gather.h"
#include "common/description/transform.h"
#include "common/description/vocabulary.h"
#include "test_description_common.h"
#include "tests/paths.h"

namespace candela::description {
namespace {

std::string scene(const std::string& body) {
  return "<scene version=\"3.0.0\">" + body + "</scene>";
}

// Claim: the four scenes that the project is measured on are understood, with all their files.
TEST(DescriptionScenes, SharedScenesParse) {
  const std::filesystem::path shared = test::shared_path();
  if (!std::filesystem::exists(shared / "scenes"))
    GTEST_SKIP() << "no scenes at " << shared << " (set CANDELA_SHARED)";
  struct Expected {
    std::string name;
    std::size_t shapes, files;
  };
  for (const Expected& expected : {Expected{"cornell-box", 8, 1}, Expected{"veach-mis", 9, 1},
                                   Expected{"veach-bidir", 14, 13}, Expected{"veach-ajar", 19, 19}}) {
    const auto gathered = bundle::gather(shared / "scenes" / expected.name / "scene.xml", {});
    ASSERT_TRUE(gathered.ok()) << gathered.error().to_string();
    const Object& root = *gathered->description.scene;
    EXPECT_EQ(root.children_of("shape").size(), expected.shapes) << expected.name;
    EXPECT_EQ(gathered->bundle.files.size(), expected.files) << expected.name;
    EXPECT_EQ(root.children_of("integrator").at(0)->plugin, "path");
    const ObjectPtr sensor = root.children_of("sensor").at(0);
    EXPECT_GT(sensor->children_of("film").at(0)->get_integer("width", 0), 0);
  }
}

// Claim: parameters come from the command line, else from <default>, longest name first, in every attribute;
// "\$" is a dollar sign.
TEST(DescriptionScenes, ParametersAreSubstituted) {
  const std::string text = scene(
      "<default name='res' value='32'/><default name='resx' value='64'/><default name='kind' value='path'/>"
      "<integrator type='$kind'><integer name='max_depth' value='$depth'/></integrator>"
      "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='$resx'/>"
      "<integer name='height' value='$res'/><string name='file_format' value='\\$$res'/></film></sensor>");
  const auto result = parse_text(text, {{"depth", "7"}, {"res", "48"}});
  ASSERT_TRUE(result.ok()) << outcome(result);
  const ObjectPtr film = result->scene->children_of("sensor").at(0)->children_of("film").at(0);
  EXPECT_EQ(film->get_integer("width", 0), 64);
  EXPECT_EQ(film->get_integer("height", 0), 48);
  EXPECT_EQ(film->get_string("file_format", ""), "$48");
  EXPECT_EQ(result->scene->children_of("integrator").at(0)->get_integer("max_depth", 0), 7);
}

// Claim: references may point forward, through aliases, and share one object.
TEST(DescriptionScenes, ReferencesShareObjects) {
  const auto result = parse_text(scene(
      "<shape type='cube'><ref id='red'/></shape>"
      "<bsdf type='diffuse' id='red'><ref name='reflectance' id='wood'/></bsdf><alias id='red' as='rot'/>"
      "<texture type='bitmap' id='wood'><string name='filename' value='./sub/../image.png'/></texture>"
      "<shape type='sphere'><ref id='rot'/></shape>"));
  ASSERT_TRUE(result.ok()) << outcome(result);
  const auto shapes = result->scene->children_of("shape");
  EXPECT_EQ(shapes.at(0)->children.at(0).object, shapes.at(1)->children.at(0).object);
  const Child* texture = shapes.at(0)->children.at(0).object->find_child("reflectance");
  ASSERT_NE(texture, nullptr);
  EXPECT_EQ(texture->object->get_string("filename", ""), "image.png");
  EXPECT_EQ(result->files, (std::vector<std::string>{"image.png", "scene.xml"}));
}

// Claim: an included scene's content stands where the include stands; its files are found beside the main
// scene, and failing that beside the included file; <path> folders come before both.
TEST(DescriptionScenes, IncludesAndSearchFolders) {
  const std::map<std::string, std::string> files = {
      {"parts/all.xml", "<scene><bsdf type='diffuse' id='b'/><include filename='lamp.xml'/></scene>"},
      {"parts/lamp.xml", "<shape type='obj'><string name='filename' value='mesh.obj'/></shape>"},
      {"parts/deep.xml", "<shape type='obj'><string name='filename' value='only_here.obj'/></shape>"},
      {"parts/only_here.obj", "v 0 0 0"},
      {"library/mesh.obj", "v 1 1 1"}};
  const auto plain =
      parse_text(scene("<include filename='parts/all.xml'/><include filename='parts/deep.xml'/>"), {}, files);
  ASSERT_TRUE(plain.ok()) << outcome(plain);
  EXPECT_EQ(plain->files, (std::vector<std::string>{"mesh.obj", "parts/all.xml", "parts/deep.xml",
                                                    "parts/lamp.xml", "parts/only_here.obj", "scene.xml"}));
  EXPECT_EQ(plain->scene->children_of("bsdf").size(), 1U);
  EXPECT_EQ(plain->scene->children_of("shape").at(0)->where.file, "parts/lamp.xml");

  const auto with_path =
      parse_text(scene("<path value='library'/><include filename='parts/all.xml'/>"), {}, files);
  ASSERT_TRUE(with_path.ok()) << outcome(with_path);
  EXPECT_EQ(with_path->scene->children_of("shape").at(0)->get_string("filename", ""), "library/mesh.obj");
}

Mat4 to_world_of(const std::string& operations) {
  const auto result = parse_text(
      scene("<shape type='cube'><transform name='to_world'>" + operations + "</transform></shape>"));
  EXPECT_TRUE(result.ok()) << outcome(result);
  return result.ok() ? result->scene->children.at(0).object->get_transform("to_world") : Mat4{};
}

void expect_near(const Mat4& actual, const Mat4& expected) {
  for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(actual[i], expected[i], 1e-15) << "entry " << i;
}

// Claim: operations act in written order, and each means what Mitsuba's means. Quarter turns are exact.
TEST(DescriptionScenes, TransformOperations) {
  EXPECT_EQ(to_world_of("<scale value='2'/><translate x='1' y='2' z='3'/>"),
            (Mat4{2, 0, 0, 1, 0, 2, 0, 2, 0, 0, 2, 3, 0, 0, 0, 1}));
  EXPECT_EQ(to_world_of("<translate value='1, 2, 3'/><scale x='2'/>"),
            (Mat4{2, 0, 0, 2, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1}));
  EXPECT_EQ(to_world_of("<rotate z='3' angle='90'/>"),
            (Mat4{0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(to_world_of("<rotate y='1' angle='-450'/>"),
            (Mat4{0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(to_world_of("<matrix value='1 2 0 0 1 0 0 0 1'/>"),
            (Mat4{1, 2, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}));
  const double s = std::sin(0.3), c = std::cos(0.3);
  expect_near(to_world_of("<rotate x='1' angle='17.188733853924695'/>"),
              {1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0, 0, 0, 0, 1});
  // From (0,0,5) towards the origin: z turns to -z, and with y up, x (the left) turns to -x.
  expect_near(to_world_of("<lookat origin='0,0,5' target='0,0,0' up='0,1,0'/>"),
              {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 5, 0, 0, 0, 1});
}

// Claim: the sine and cosine in rotations are right to rounding over the whole circle.
TEST(DescriptionScenes, RotationMatchesLibm) {
  for (int i = -800; i <= 800; ++i) {
    const double degrees = i * 0.937;
    const Mat4 matrix = *transform::rotate({0, 0, 1}, degrees);
    const long double radians = static_cast<long double>(degrees) * std::numbers::pi_v<long double> / 180;
    EXPECT_NEAR(matrix[0], static_cast<double>(std::cos(radians)), 3e-16);
    EXPECT_NEAR(matrix[4], static_cast<double>(std::sin(radians)), 3e-16);
  }
}

// Claim: colours come out linear whatever way they are written.
TEST(DescriptionScenes, Colours) {
  const auto colour = [](const std::string& element) {
    const auto result = parse_text(scene("<emitter type='constant'>" + element + "</emitter>"));
    EXPECT_TRUE(result.ok()) << outcome(result);
    return result.ok() ? result->scene->children.at(0).object->get_rgb("radiance").value().value : Vec3{};
  };
  EXPECT_EQ(colour("<rgb name='radiance' value='1, 2 3e2'/>"), (Vec3{1, 2, 300}));
  EXPECT_EQ(colour("<rgb name='radiance' value='+4'/>"), (Vec3{4, 4, 4}));
  EXPECT_EQ(colour("<float name='radiance' value='6'/>"), (Vec3{6, 6, 6}));
  const Vec3 hex = colour("<rgb name='radiance' value='#ff8000'/>");
  EXPECT_NEAR(hex[0], 1, 1e-15);
  EXPECT_NEAR(hex[1], std::pow((128 / 255.0 + 0.055) / 1.055, 2.4), 1e-15);
  EXPECT_EQ(hex[2], 0);
  for (int i = 0; i <= 1000; ++i) {
    const double x = i / 1000.0;
    EXPECT_NEAR(transform::srgb_to_linear(x), x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4),
                1e-14);
  }
}

// Claim: a colour in the place of a number that a texture may stand for counts by its luminance; of other
// numbers it is an error.
TEST(DescriptionScenes, ColoursAsNumbers) {
  const auto alpha = [](const std::string& element) {
    const auto result = parse_text(scene("<bsdf type='roughconductor'>" + element + "</bsdf>"));
    EXPECT_TRUE(result.ok()) << outcome(result);
    return result.ok() ? result->scene->children.at(0).object->get_number("alpha", -1) : -1;
  };
  EXPECT_EQ(alpha("<rgb name='alpha' value='0.3'/>"), 0.3);
  EXPECT_EQ(alpha("<spectrum name='alpha' value='0.7'/>"), 0.7);
  EXPECT_NEAR(alpha("<rgb name='alpha' value='0, 1, 0'/>"), 0.71516, 1e-12);
  EXPECT_EQ(outcome(parse_text(scene("<shape type='sphere'><rgb name='radius' value='1'/></shape>"))),
            "scene.xml:1: parameter 'radius' is a rgb, but must be <float>");
}

// Claim: a scene in 0.6 spelling and the same scene in today's are the same objects.
TEST(DescriptionScenes, OldSpellingEqualsNew) {
  const std::string old_spelling = R"(<scene version="0.6.0">
    <integrator type="path"><integer name="maxDepth" value="8"/><integer name="rrDepth" value="3"/>
      <boolean name="strictNormals" value="false"/><boolean name="hideEmitters" value="true"/></integrator>
    <sensor type="perspective"><string name="fovAxis" value="smaller"/><float name="fov" value="40"/>
      <float name="nearClip" value="1"/><float name="farClip" value="100"/>
      <transform name="toWorld"><lookAt origin="1,2,3" target="0,0,0" up="0,0,1"/></transform>
      <sampler type="ldsampler"><integer name="sampleCount" value="16"/></sampler>
      <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/>
        <string name="pixelFormat" value="rgb"/><string name="fileFormat" value="openexr"/><rfilter type="gaussian"/></film>
    </sensor>
    <texture type="bitmap" id="t"><string name="filename" value="image.png"/><string name="filterType" value="trilinear"/>
      <string name="wrapModeU" value="clamp"/><string name="wrapModeV" value="clamp"/>
      <float name="uscale" value="2"/><float name="voffset" value="0.25"/></texture>
    <bsdf type="diffuse" id="_d"><ref name="diffuseReflectance" id="t"/></bsdf>
    <bsdf type="dielectric" id="g"><string name="intIOR" value="Water"/><float name="extIOR" value="1"/></bsdf>
    <bsdf type="roughconductor" id="m"><float name="alphaU" value="0.1"/><float name="alphaV" value="0.2"/>
      <rgb name="eta" value="1,2,3"/><rgb name="k" value="4,5,6"/><string name="extEta" value="vacuum"/>
      <spectrum name="specularReflectance" value="0.5"/></bsdf>
    <shape type="serialized"><string name="filename" value="mesh.obj"/><integer name="shapeIndex" value="2"/>
      <boolean name="faceNormals" value="true"/><boolean name="flipNormals" value="true"/><ref id="_d"/></shape>
    <shape type="sphere"><point name="center" x="1" y="2" z="3"/><ref id="g"/></shape>
    <emitter type="directional"><vector name="direction" x="0" y="-1" z="0"/><float name="samplingWeight" value="2"/>
      <spectrum name="irradiance" value="3"/></emitter></scene>)";
  const std::string new_spelling = R"(<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="8"/><integer name="rr_depth" value="3"/>
      <boolean name="strict_normals" value="false"/><boolean name="hide_emitters" value="true"/></integrator>
    <sensor type="perspective"><string name="fov_axis" value="smaller"/><float name="fov" value="40"/>
      <float name="near_clip" value="1"/><float name="far_clip" value="100"/>
      <transform name="to_world"><lookat origin="1,2,3" target="0,0,0" up="0,0,1"/></transform>
      <sampler type="ldsampler"><integer name="sample_count" value="16"/></sampler>
      <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="48"/>
        <string name="pixel_format" value="rgb"/><string name="file_format" value="openexr"/><rfilter type="gaussian"/></film>
    </sensor>
    <texture type="bitmap" id="t"><string name="filename" value="image.png"/><string name="filter_type" value="bilinear"/>
      <transform name="to_uv"><scale x="2"/><translate y="0.25"/></transform>
      <string name="wrap_mode" value="clamp"/></texture>
    <bsdf type="diffuse" id="d"><ref name="reflectance" id="t"/></bsdf>
    <bsdf type="dielectric" id="g"><float name="int_ior" value="1.333"/><float name="ext_ior" value="1"/></bsdf>
    <bsdf type="roughconductor" id="m"><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.2"/>
      <rgb name="eta" value="1,2,3"/><rgb name="k" value="4,5,6"/>
      <spectrum name="specular_reflectance" value="0.5"/></bsdf>
    <shape type="serialized"><string name="filename" value="mesh.obj"/><integer name="shape_index" value="2"/>
      <boolean name="face_normals" value="true"/><boolean name="flip_normals" value="true"/><ref id="d"/></shape>
    <shape type="sphere"><point name="center" x="1" y="2" z="3"/><ref id="g"/></shape>
    <emitter type="directional"><vector name="direction" x="0" y="-1" z="0"/><float name="sampling_weight" value="2"/>
      <rgb name="irradiance" value="3"/></emitter></scene>)";
  const auto old_scene = parse_text(old_spelling);
  const auto new_scene = parse_text(new_spelling);
  ASSERT_TRUE(old_scene.ok()) << outcome(old_scene);
  ASSERT_TRUE(new_scene.ok()) << outcome(new_scene);
  std::string old_text = dump(*old_scene->scene);
  // The reserved underscore is the one allowed difference.
  for (std::size_t at = old_text.find("#_d"); at != std::string::npos; at = old_text.find("#_d"))
    old_text.erase(at + 1, 1);
  EXPECT_EQ(old_text, dump(*new_scene->scene));
}

// Claim: so are the dielectrics and plastics of 0.6.
TEST(DescriptionScenes, OldDielectricsAndPlasticsEqualNew) {
  const auto parsed = [](const std::string& version, const std::string& bsdfs) {
    return parse_text("<scene version='" + version + "'>" + bsdfs + "</scene>");
  };
  const auto old_scene = parsed("0.6.0", R"(
    <bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alphaU" value="0.1"/>
      <float name="alphaV" value="0.2"/><string name="intIOR" value="water"/><float name="extIOR" value="1"/>
      <boolean name="sampleVisible" value="false"/><spectrum name="specularTransmittance" value="0.5"/></bsdf>
    <bsdf type="thindielectric"><float name="intIOR" value="1.6"/><spectrum name="specularReflectance" value="0.5"/></bsdf>
    <bsdf type="plastic"><float name="intIOR" value="1.6"/><rgb name="diffuseReflectance" value="0.1,0.2,0.3"/>
      <boolean name="nonlinear" value="true"/></bsdf>
    <bsdf type="roughplastic"><float name="alpha" value="0.3"/><string name="extIOR" value="water"/>
      <string name="distribution" value="beckmann"/><spectrum name="specularReflectance" value="0.5"/></bsdf>)");
  const auto new_scene = parsed("3.0.0", R"(
    <bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha_u" value="0.1"/>
      <float name="alpha_v" value="0.2"/><string name="int_ior" value="water"/><float name="ext_ior" value="1"/>
      <boolean name="sample_visible" value="false"/><spectrum name="specular_transmittance" value="0.5"/></bsdf>
    <bsdf type="thindielectric"><float name="int_ior" value="1.6"/><spectrum name="specular_reflectance" value="0.5"/></bsdf>
    <bsdf type="plastic"><float name="int_ior" value="1.6"/><rgb name="diffuse_reflectance" value="0.1,0.2,0.3"/>
      <boolean name="nonlinear" value="true"/></bsdf>
    <bsdf type="roughplastic"><float name="alpha" value="0.3"/><string name="ext_ior" value="water"/>
      <string name="distribution" value="beckmann"/><spectrum name="specular_reflectance" value="0.5"/>
      <string name="masked_light" value="stays"/></bsdf>)");
  ASSERT_TRUE(old_scene.ok()) << outcome(old_scene);
  ASSERT_TRUE(new_scene.ok()) << outcome(new_scene);
  EXPECT_EQ(dump(*old_scene->scene), dump(*new_scene->scene));
  EXPECT_NE(dump(*new_scene->scene).find("roughplastic"), std::string::npos);
}

// Claim: another integrator of Mitsuba's is kept for the command line to override, its parameters unread.
TEST(DescriptionScenes, OtherIntegratorsAreKept) {
  const auto result =
      parse_text(scene("<integrator type='vpl'><boolean name='whatever' value='true'/></integrator>"));
  ASSERT_TRUE(result.ok()) << outcome(result);
  const ObjectPtr integrator = result->scene->children_of("integrator").at(0);
  EXPECT_EQ(integrator->plugin, "vpl");
  EXPECT_EQ(find_plugin("integrator", "vpl"), nullptr);
  EXPECT_TRUE(integrator->get_bool("whatever", false));
}

// Claim: lines are right whatever stands before an element.
TEST(DescriptionScenes, LinesAreRight) {
  const auto result = parse_text(
      "\xEF\xBB\xBF<!-- a\nb -->\n<scene version='3.0.0'>\r\n<!-- c\n\n -->\n  <shape type='cube'\n"
      " id='x'/>\n<bsdf type='diffuse'/></scene>");
  ASSERT_TRUE(result.ok()) << outcome(result);
  EXPECT_EQ(result->scene->where.line, 3);
  EXPECT_EQ(result->scene->children.at(0).object->where.line, 7);
  EXPECT_EQ(result->scene->children.at(1).object->where.line, 9);
}

}  // namespace
}  // namespace candela::description
