// Scenes of pbrt's version 4: each means what a scene of Mitsuba's XML means, or is an error that names its
// place.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/description/reading.h"
#include "test_description_common.h"
#include "tests/unit/description_pbrt_reading.h"

namespace candela::description {
namespace {

std::string xml_world(const std::string& world) {
  const auto read = parse_text("<scene version=\"3.0.0\">" + world + "</scene>", {}, {{"rgba.png", ""}});
  return read.ok() ? world_of(*read->scene) : outcome(read);
}

std::string matrix(const std::string& values) {
  return "<transform name='to_world'><matrix value='" + values + "'/></transform>";
}

const std::string kUnit = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1";
// A sphere as pbrt has it: v from the bottom.
std::string xml_sphere(const std::string& inside) {
  return "<shape type='sphere'><float name='radius' value='1'/>" +
         matrix("1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1") + inside + "</shape>";
}
std::string xml_twosided(const std::string& bsdf) {
  return "<bsdf type='twosided'>" + bsdf + "</bsdf>";
}
// The bsdf with an id.
std::string named(std::string bsdf, const std::string& id) {
  return bsdf.insert(std::string("<bsdf").size(), " id='" + id + "'");
}
std::string gray(const std::string& name, double value) {
  const std::string v = fmt::format("{}", value);
  return "<rgb name='" + name + "' value='" + v + ", " + v + ", " + v + "'/>";
}

struct Twin {
  std::string pbrt, xml;
};

// Claim: materials, lights and shapes are those of our vocabulary, with pbrt's defaults, its two-sided opaque
// materials, its roughness as the root of alpha, and indices of metals under a coat divided by the coat's.
TEST(DescriptionPbrt, WorldsMeanTheSameAsTheirTwins) {
  const std::string half = xml_twosided("<bsdf type='diffuse'>" + gray("reflectance", 0.5) + "</bsdf>");
  const std::vector<Twin> twins = {
      {"Shape \"sphere\"", xml_sphere(half)},
      {"Material \"diffuse\" \"rgb reflectance\" [ .1 .2 .3 ]\nShape \"sphere\"",
       xml_sphere(xml_twosided("<bsdf type='diffuse'><rgb name='reflectance' value='.1,.2,.3'/></bsdf>"))},
      {"Material \"dielectric\" \"float eta\" 1.33\nShape \"sphere\"",
       xml_sphere("<bsdf type='dielectric'><float name='int_ior' value='1.33'/><float name='ext_ior' "
                  "value='1'/></bsdf>")},
      {"Material \"dielectric\" \"float roughness\" 0.25\nShape \"sphere\"",
       xml_sphere(
           "<bsdf type='roughdielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' "
           "value='1'/><string name='distribution' value='ggx'/><float name='alpha' value='0.5'/></bsdf>")},
      {"Material \"dielectric\" \"float uroughness\" 0.25 \"float vroughness\" 0.04\nShape \"sphere\"",
       xml_sphere(
           "<bsdf type='roughdielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' "
           "value='1'/><string name='distribution' value='ggx'/><float name='alpha_u' value='0.5'/><float "
           "name='alpha_v' value='0.2'/></bsdf>")},
      {"Material \"conductor\" \"rgb eta\" [1 2 3] \"rgb k\" [4 5 6] \"float roughness\" .3 \"bool "
       "remaproughness\" false\nShape \"sphere\"",
       xml_sphere(xml_twosided("<bsdf type='roughconductor'><rgb name='eta' value='1,2,3'/><rgb name='k' "
                               "value='4,5,6'/><string name='distribution' value='ggx'/><float name='alpha' "
                               "value='0.3'/></bsdf>"))},
      {"Material \"conductor\" \"spectrum eta\" \"metal-Au-eta\" \"spectrum k\" \"metal-Au-k\"\nShape "
       "\"sphere\"",
       xml_sphere(xml_twosided("<bsdf type='conductor'><string name='material' value='Au'/></bsdf>"))},
      {"Material \"coatedconductor\" \"rgb conductor.eta\" [3 3 3] \"rgb conductor.k\" [1.5 3 6] \"float "
       "interface.eta\" 1.5\nShape \"sphere\"",
       xml_sphere(xml_twosided(
           "<bsdf type='coating'><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/><bsdf "
           "type='conductor'><rgb name='eta' value='2,2,2'/><rgb name='k' value='1,2,4'/></bsdf></bsdf>"))},
      {"Material \"coateddiffuse\"\nShape \"sphere\"",
       xml_sphere(xml_twosided("<bsdf type='plastic'>" + gray("diffuse_reflectance", 0.5) +
                               "<float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/><boolean "
                               "name='nonlinear' value='true'/></bsdf>"))},
      {"Material \"interface\"\nShape \"sphere\"", xml_sphere("<bsdf type='null'/>")},
      {"MakeNamedMaterial \"a\" \"string type\" \"thindielectric\"\nMakeNamedMaterial \"b\" \"string type\" "
       "\"mix\" \"string materials\" [\"a\" \"c\"] \"float amount\" 0.25\nNamedMaterial \"b\"\nShape "
       "\"sphere\"\nMakeNamedMaterial \"c\" \"string type\" \"diffuse\"",
       xml_sphere("<bsdf type='blendbsdf' id='b'><float name='weight' value='0.25'/><bsdf "
                  "type='thindielectric' id='a'>"
                  "<float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf>" +
                  named(half, "c") + "</bsdf>")},
      {"Material \"diffusetransmission\" \"rgb reflectance\" [.6 .1 .1] \"rgb transmittance\" [.1 .6 .1] "
       "\"float scale\" .5\nShape \"sphere\"",
       xml_sphere("<bsdf type='difftrans'><rgb name='reflectance' value='.3,.05,.05'/><rgb "
                  "name='transmittance' value='.05,.3,.05'/></bsdf>")},
      {"Shape \"sphere\" \"float alpha\" 0.25",
       xml_sphere("<bsdf type='mask'><float name='opacity' value='0.25'/>" + half + "</bsdf>")},
      {"Translate 1 2 3\nShape \"cylinder\" \"float radius\" 2 \"float zmax\" 4",
       "<shape type='cylinder'><float name='radius' value='2'/><point name='p0' value='0,0,-1'/><point "
       "name='p1' "
       "value='0,0,4'/>" +
           matrix("1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1") + half + "</shape>"},
      {"ReverseOrientation\nShape \"disk\" \"float radius\" 2 \"float height\" 3",
       "<shape type='disk'>" + matrix("2 0 0 0 0 2 0 0 0 0 2 3 0 0 0 1") +
           "<boolean name='flip_normals' value='true'/>" + half + "</shape>"},
      {"AreaLightSource \"diffuse\" \"rgb L\" [1 2 3] \"float scale\" 2\nShape \"sphere\"",
       xml_sphere(half + "<emitter type='area'><rgb name='radiance' value='2,4,6'/></emitter>")},
      {"Translate 1 0 0\nLightSource \"point\" \"rgb I\" [1 2 3] \"point3 from\" [0 1 0]",
       "<emitter type='point'><rgb name='intensity' value='1,2,3'/><point name='position' "
       "value='1,1,0'/></emitter>"},
      {"LightSource \"distant\" \"point3 from\" [0 0 5] \"point3 to\" [1 0 5] \"float illuminance\" 7",
       "<emitter type='directional'><rgb name='irradiance' value='7,7,7'/><point name='direction' "
       "value='1,0,0'/></emitter>"},
      {"LightSource \"infinite\" \"rgb L\" [.5 .5 .5] \"float scale\" 4",
       "<emitter type='constant'>" + gray("radiance", 2) + "</emitter>"},
      {"LightSource \"infinite\" \"string filename\" \"image.png\" \"float scale\" 4",
       "<emitter type='envmap'><string name='filename' value='image.png'/><string name='mapping' "
       "value='equalarea'/><float name='scale' value='4'/>" +
           matrix(kUnit) + "</emitter>"},
      // 3 W/sr of luminance times the power 5; the picture's right is +x, which is the left of ours.
      {"LightSource \"projection\" \"string filename\" \"image.png\" \"float fov\" 40 \"float scale\" 3 "
       "\"float "
       "power\" 5",
       "<emitter type='projector'><texture name='irradiance' type='bitmap'><string name='filename' "
       "value='image.png'/><string name='filter_type' value='nearest'/><string name='wrap_mode' "
       "value='clamp'/></texture><float name='power' value='15'/><string name='quantity' "
       "value='intensity'/><float name='fov' value='40'/><string name='fov_axis' value='smaller'/>" +
           matrix("-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1") + "</emitter>"},
      {"LightSource \"goniometric\" \"string filename\" \"image.png\" \"rgb I\" [2 2 2]",
       "<emitter type='goniometric'><string name='filename' value='image.png'/>" + gray("intensity", 2) +
           matrix(kUnit) + "</emitter>"},
      // Half of the power leaves the one side that glows here.
      {"AreaLightSource \"diffuse\" \"float power\" 10 \"bool twosided\" true \"float scale\" 2\nShape "
       "\"sphere\"",
       xml_sphere(half + "<emitter type='area'><float name='power' value='10'/>" + gray("radiance", 2) +
                  "</emitter>")},
      {"LightSource \"infinite\" \"string filename\" \"image.png\" \"float illuminance\" 4 \"float scale\" "
       "3",
       "<emitter type='envmap'><string name='filename' value='image.png'/><string name='mapping' "
       "value='equalarea'/><float name='illuminance' value='12'/>" +
           matrix(kUnit) + "</emitter>"},
      {"MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [1 1 1] \"rgb sigma_s\" [3 3 "
       "3] "
       "\"float g\" 0.5\nMediumInterface \"fog\" \"\"\nMaterial \"interface\"\nShape \"sphere\"",
       xml_sphere(
           "<bsdf type='null'/><medium name='interior' id='fog' type='homogeneous'>" + gray("sigma_t", 4) +
           gray("albedo", 0.75) +
           "<float name='scale' value='1'/><phase type='hg'><float name='g' value='0.5'/></phase></medium>")},
  };
  for (const Twin& twin : twins) EXPECT_EQ(pbrt_world(twin.pbrt), xml_world(twin.xml)) << twin.pbrt;
}

// Claim: textures are looked up as pbrt does: rows from the bottom, its scale and shift of u and v, squares
// of width 1, constants folded into the parameter.
TEST(DescriptionPbrt, TexturesMeanTheSameAsTheirTwins) {
  const auto on_sphere = [](const std::string& texture) {
    return xml_sphere(xml_twosided("<bsdf type='diffuse'>" + texture + "</bsdf>"));
  };
  const std::string use = "\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"";
  const auto to_uv = [](const std::string& values) {
    return "<transform name='to_uv'><matrix value='" + values + "'/></transform>";
  };
  const auto named_picture = [&](const std::string& slot) {
    return "<texture name='" + slot + "' type='bitmap'><string name='filename' value='image.png'/>" +
           to_uv("1 0 0 0 0 -1 0 1 0 0 1 0 0 0 0 1") + "<string name='wrap_mode' value='repeat'/></texture>";
  };
  const std::string picture = named_picture("");
  // A float texture: the mean of the channels.
  const auto named_number = [&](const std::string& slot) {
    return "<texture name='" + slot +
           "' type='bitmap'><string name='channel' value='number'/><string name='filename' "
           "value='image.png'/>" +
           to_uv("1 0 0 0 0 -1 0 1 0 0 1 0 0 0 0 1") + "<string name='wrap_mode' value='repeat'/></texture>";
  };
  const std::string plain_turn =
      "<boolean name='flip_invalid_normals' value='false'/><boolean name='use_shadowing_function' "
      "value='false'/>";
  const std::vector<Twin> twins = {
      {"Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [.1 .2 .3]" + use,
       on_sphere("<rgb name='reflectance' value='.1,.2,.3'/>")},
      {"Texture \"c\" \"spectrum\" \"constant\" \"rgb value\" [.5 .5 .5]\nTexture \"t\" \"spectrum\" "
       "\"scale\" "
       "\"texture tex\" \"c\" \"float scale\" .5" +
           use,
       on_sphere(gray("reflectance", 0.25))},
      {"Texture \"t\" \"spectrum\" \"mix\" \"rgb tex1\" [0 0 0] \"rgb tex2\" [1 1 1] \"float amount\" .25" +
           use,
       on_sphere(gray("reflectance", 0.25))},
      {"Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"image.png\" \"float uscale\" 2 \"float "
       "vscale\" 3 \"float udelta\" .5 \"string wrap\" \"clamp\"" +
           use,
       on_sphere("<texture name='reflectance' type='bitmap'><string name='filename' value='image.png'/>" +
                 to_uv("2 0 0 0.5 0 -3 0 1 0 0 1 0 0 0 0 1") +
                 "<string name='wrap_mode' value='clamp'/></texture>")},
      {"Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 8 \"float vscale\" 4 \"rgb tex1\" [.9 "
       ".9 .9] "
       "\"rgb tex2\" [.1 .1 .1]" +
           use,
       on_sphere("<texture name='reflectance' type='checkerboard'>" +
                 to_uv("4 0 0 0 0 2 0 0 0 0 1 0 0 0 0 1") + gray("color0", 0.9) + gray("color1", 0.1) +
                 "</texture>")},
      // Values above 1 become 1.
      {"Texture \"i\" \"spectrum\" \"imagemap\" \"string filename\" \"image.png\"\nTexture \"t\" "
       "\"spectrum\" "
       "\"scale\" \"texture tex\" \"i\" \"float scale\" 1.5" +
           use,
       on_sphere("<texture name='reflectance' type='mix'><texture name='color0' type='scale'>" +
                 gray("scale", 1.5) + picture +
                 "</texture><float name='amount' value='0'/><float name='maximum' "
                 "value='1'/></texture>")},
      {"Texture \"i\" \"spectrum\" \"imagemap\" \"string filename\" \"image.png\"\nTexture \"f\" \"float\" "
       "\"imagemap\" \"string filename\" \"image.png\"\nTexture \"t\" \"spectrum\" \"mix\" \"texture tex1\" "
       "\"i\" "
       "\"rgb tex2\" [.5 .5 .5] \"texture amount\" \"f\"\nMaterial \"diffuse\" \"texture reflectance\" "
       "\"t\"\nShape "
       "\"sphere\"",
       on_sphere("<texture name='reflectance' type='mix'><texture name='color0' type='mix'>" +
                 named_picture("color0") + gray("color1", 0.5) + named_number("amount") +
                 "</texture><float name='amount' value='0'/><float name='maximum' value='1'/></texture>")},
      // Displacements may go down; a picture's alpha is the opacity.
      {"Texture \"i\" \"float\" \"imagemap\" \"string filename\" \"image.png\"\nTexture \"t\" \"float\" "
       "\"scale\" "
       "\"texture tex\" \"i\" \"float scale\" -.5\nMaterial \"diffuse\" \"texture displacement\" "
       "\"t\"\nShape "
       "\"sphere\"",
       xml_sphere("<bsdf type='bumpmap'><texture name='texture' type='scale'>" + gray("scale", 0.5) +
                  named_number("") + "</texture><float name='scale' value='-1'/>" + plain_turn +
                  xml_twosided("<bsdf type='diffuse'>" + gray("reflectance", 0.5) + "</bsdf>") + "</bsdf>")},
      {"Material \"diffuse\" \"string normalmap\" \"image.png\"\nShape \"sphere\"",
       xml_sphere("<bsdf type='normalmap'><texture name='normalmap' type='bitmap'><string name='filename' "
                  "value='image.png'/>" +
                  to_uv("1 0 0 0 0 -1 0 1 0 0 1 0 0 0 0 1") + "<boolean name='raw' value='true'/></texture>" +
                  plain_turn + xml_twosided("<bsdf type='diffuse'>" + gray("reflectance", 0.5) + "</bsdf>") +
                  "</bsdf>")},
      {"Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"rgba.png\"\nShape \"sphere\" \"texture "
       "alpha\" "
       "\"t\"",
       xml_sphere("<bsdf type='mask'><texture name='opacity' type='bitmap'><string name='channel' "
                  "value='number'/><string name='filename' value='rgba.png'/>" +
                  to_uv("1 0 0 0 0 -1 0 1 0 0 1 0 0 0 0 1") +
                  "<string name='wrap_mode' value='repeat'/></texture>" +
                  xml_twosided("<bsdf type='diffuse'>" + gray("reflectance", 0.5) + "</bsdf>") + "</bsdf>")},
      // Alpha is the root of the roughness.
      {"Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"image.png\" \"string encoding\" "
       "\"linear\"\n"
       "Material \"dielectric\" \"texture roughness\" \"t\"\nShape \"sphere\"",
       xml_sphere(
           "<bsdf type='roughdielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' "
           "value='1'/><string name='distribution' value='ggx'/><texture name='alpha' type='mix'><texture "
           "name='color0' type='bitmap'><string name='channel' value='number'/><string name='filename' "
           "value='image.png'/>" +
           to_uv("1 0 0 0 0 -1 0 1 0 0 1 0 0 0 0 1") +
           "<string name='wrap_mode' value='repeat'/><boolean name='raw' value='true'/></texture><float "
           "name='amount' value='0'/><boolean name='root' value='true'/></texture></bsdf>")},
      {"Texture \"a\" \"float\" \"checkerboard\"\nTexture \"t\" \"float\" \"mix\" \"texture amount\" "
       "\"a\" \"float tex1\" .25 \"float tex2\" .5\nMaterial \"coateddiffuse\" \"texture roughness\" "
       "\"t\" \"bool remaproughness\" false\nShape \"sphere\"",
       xml_sphere(xml_twosided(
           "<bsdf type='roughplastic'>" + gray("diffuse_reflectance", 0.5) +
           "<float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/><boolean name='nonlinear' "
           "value='true'/><string name='distribution' value='ggx'/><texture name='alpha' type='mix'>" +
           gray("color0", 0.25) + gray("color1", 0.5) + "<texture name='amount' type='checkerboard'>" +
           to_uv("0.5 0 0 0 0 0.5 0 0 0 0 1 0 0 0 0 1") + gray("color0", 1) + gray("color1", 0) +
           "</texture></texture></bsdf>"))},
  };
  for (const Twin& twin : twins) EXPECT_EQ(pbrt_world(twin.pbrt), xml_world(twin.xml)) << twin.pbrt;
}

// Claim: scopes keep and give back the whole state, TransformBegin's too; Attribute, coordinate systems,
// Include and Import work on it as pbrt's do.
TEST(DescriptionPbrt, TheStateOfTheFileCounts) {
  const std::string at_1 = "Translate 1 0 0\nShape \"cylinder\"";
  const std::vector<Twin> same = {
      {"AttributeBegin\nTranslate 5 5 5\nMaterial \"interface\"\nReverseOrientation\nAttributeEnd\n" + at_1,
       at_1},
      {"TransformBegin\nTranslate 5 5 5\nMaterial \"interface\"\nReverseOrientation\nTransformEnd\n" + at_1,
       at_1},
      {"TransformBegin\nTranslate 5 5 5\nAttributeEnd\n" + at_1, at_1},
      {"Transform [1 0 0 0  0 1 0 0  0 0 1 0  1 0 0 1]\nShape \"cylinder\"", at_1},
      {"Rotate 30 1 2 3\nIdentity\n" + at_1, at_1},
      {"Translate 1 0 0\nCoordinateSystem \"here\"\nTranslate 1 0 0\nCoordSysTransform \"here\"\nShape "
       "\"cylinder\"",
       at_1},
      {"Translate 0 0 -3\nConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  1 0 3 1]\nShape \"cylinder\"", at_1},
      {"ActiveTransform EndTime\nTranslate 7 7 7\nActiveTransform All\n" + at_1, at_1},
      {"Attribute \"shape\" \"float radius\" 2\nShape \"cylinder\"", "Shape \"cylinder\" \"float radius\" 2"},
      {"Attribute \"shape\" \"float radius\" 2\nShape \"cylinder\" \"float radius\" 3",
       "Shape \"cylinder\" \"float radius\" 3"},
      {"# a comment with \"quotes\" [\nShape \"cylinder\" \"float radius\" [ 2 ] # and\n",
       "Shape\n\"cylinder\"\t\"float  radius\"2"},
  };
  for (const Twin& twin : same) EXPECT_EQ(pbrt_world(twin.pbrt), pbrt_world(twin.xml)) << twin.pbrt;

  const Files files = {{"parts/a.pbrt", "Translate 1 0 0\nInclude \"parts/b.pbrt\"\n"},
                       {"parts/b.pbrt", "Shape \"cylinder\"\n"}};
  const auto included = read_pbrt("WorldBegin\nInclude \"parts/a.pbrt\"\nShape \"cylinder\"", files);
  ASSERT_TRUE(included.ok()) << outcome_of(included);
  EXPECT_EQ(world_of(*included->description.scene), pbrt_world(at_1) + pbrt_world(at_1));
  EXPECT_EQ(included->description.files,
            (std::vector<std::string>{"parts/a.pbrt", "parts/b.pbrt", "scene.pbrt"}));
  const auto imported = read_pbrt("WorldBegin\nImport \"parts/a.pbrt\"\nShape \"cylinder\"", files);
  ASSERT_TRUE(imported.ok()) << outcome_of(imported);
  EXPECT_EQ(world_of(*imported->description.scene), pbrt_world(at_1) + pbrt_world("Shape \"cylinder\""));
}

// Claim: an object's shapes keep the transform of their definition; instances have their own; lamps do not
// glow there, and that is told.
TEST(DescriptionPbrt, ObjectsAreInstanced) {
  const auto read = read_pbrt(
      "WorldBegin\nObjectBegin \"o\"\nTranslate 1 0 0\nAreaLightSource \"diffuse\"\nShape "
      "\"cylinder\"\nObjectEnd\n"
      "Translate 0 2 0\nObjectInstance \"o\"\nScale 1 2 3\nObjectInstance \"o\"\nShape \"disk\"");
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  const auto shapes = read->description.scene->children_of("shape");
  ASSERT_EQ(shapes.size(), 3U);
  EXPECT_EQ(shapes[0]->plugin, "pbrtmesh");  // a disk scaled unevenly
  EXPECT_TRUE(shapes[0]->children_of("emitter").empty());
  for (std::size_t i = 1; i < 3; ++i) {
    EXPECT_EQ(shapes[i]->plugin, "instance");
    EXPECT_EQ(shapes[i]->get_transform("to_world")[7], 2);
    EXPECT_EQ(shapes[i]->get_transform("to_world")[5], i == 1 ? 1 : 2);
  }
  const ObjectPtr group = shapes[1]->children_of("shape").at(0);
  EXPECT_EQ(group, shapes[2]->children_of("shape").at(0));
  const ObjectPtr inside = group->children_of("shape").at(0);
  EXPECT_EQ(inside->get_transform("to_world")[3], 1);
  EXPECT_TRUE(inside->children_of("emitter").empty());
  bool told = false;
  for (const Note& note : read->description.notes)
    told |= note.text.find("does not glow") != std::string::npos;
  EXPECT_TRUE(told);
}

// Claim: curves that follow each other are read as one shape, unless something but their geometry differs.
TEST(DescriptionPbrt, CurvesAreGathered) {
  const std::string curve = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] ";
  const auto counts = [&](const std::string& world) {
    const auto read = read_pbrt("WorldBegin\n" + world);
    EXPECT_TRUE(read.ok()) << outcome_of(read);
    std::string text;
    if (read.ok())
      for (const ObjectPtr& shape : read->description.scene->children_of("shape"))
        text += fmt::format("{} ", shape->get_integer("curves", 0));
    return text;
  };
  EXPECT_EQ(counts(curve), "1 ");
  EXPECT_EQ(counts(curve + curve + "\"float width0\" 0.1 " + curve), "3 ");
  EXPECT_EQ(counts(curve + "Translate 1 0 0 " + curve + curve), "1 2 ");
  EXPECT_EQ(counts(curve + "Shape \"sphere\" " + curve), "1 0 1 ");
  EXPECT_EQ(counts(curve + "Material \"diffuse\" " + curve), "1 1 ");
  EXPECT_EQ(counts(curve + "\"float alpha\" 0.5 " + curve), "1 1 ");
  EXPECT_EQ(counts("ObjectBegin \"o\" " + curve + curve + "ObjectEnd " + curve), "1 ");
  const auto wrong = read_pbrt("WorldBegin\n" + curve + "\"string type\" \"round\"");
  EXPECT_NE(outcome_of(wrong).find("type of curve"), std::string::npos) << outcome_of(wrong);
}

// Claim: a grid of densities is a grid volume that refers to its directive, with pbrt's box and its fall to 0
// at the border.
TEST(DescriptionPbrt, GridsOfDensitiesStayInTheirFile) {
  const std::string before = "Translate 1 0 0\n";
  const std::string medium =
      "MakeNamedMedium \"smoke\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [ 1 2 ] "
      "\"point3 p0\" [ 0 5 0 ] \"point3 p1\" [ 2 1 1 ] \"rgb sigma_a\" [ 1 2 3 ] \"rgb sigma_s\" [ 3 2 1 ] "
      "\"float scale\" 10 \"float g\" 0.5\n";
  const std::string world =
      "WorldBegin\nMediumInterface \"smoke\" \"\"\nMaterial \"interface\"\nShape \"sphere\"";
  const auto read = read_pbrt(before + medium + world);
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  const auto shapes = read->description.scene->children_of("shape");
  ASSERT_EQ(shapes.size(), 1U);
  const Child* inside = shapes[0]->find_child("interior");
  ASSERT_NE(inside, nullptr);
  EXPECT_EQ(inside->object->plugin, "heterogeneous");
  EXPECT_EQ(inside->object->get_number("scale", 0), 10);
  EXPECT_EQ(inside->object->get_rgb("albedo")->value, (Vec3{0.75, 0.5, 0.25}));
  EXPECT_EQ(inside->object->children_of("phase").size(), 1U);
  const Child* grid = inside->object->find_child("sigma_t");
  ASSERT_NE(grid, nullptr);
  EXPECT_EQ(grid->object->get_integer("offset", 0), static_cast<std::int64_t>(before.size()));
  EXPECT_EQ(grid->object->get_rgb("factor")->value, (Vec3{4, 4, 4}));
  EXPECT_EQ(grid->object->get_string("wrap_mode", ""), "zero");
  EXPECT_EQ(grid->object->get_transform("to_world"), (Mat4{2, 0, 0, 1, 0, 4, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1}));
  const auto flat =
      read_pbrt("MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"point3 p1\" [ 1 1 0 ]");
  EXPECT_NE(outcome_of(flat).find("no volume"), std::string::npos) << outcome_of(flat);
  const auto shared = read_pbrt(
      "Attribute \"medium\" \"float g\" 0.1\nMakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"float "
      "density\" 1");
  EXPECT_NE(outcome_of(shared).find("given by Attribute"), std::string::npos) << outcome_of(shared);
}

// Claim: fronts are those of pbrt: ReverseOrientation turns a mesh around, a mirror does not.
TEST(DescriptionPbrt, FrontsFollowMirrors) {
  const auto flips = [](const std::string& before, const std::string& after) {
    const auto read = read_pbrt("WorldBegin\n" + before +
                                "\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]" + after);
    EXPECT_TRUE(read.ok()) << outcome_of(read);
    return read.ok() && read->description.scene->children_of("shape").at(0)->get_bool("flip_normals", false);
  };
  const std::string normals = " \"normal N\" [0 0 1 0 0 1 0 0 1]";
  EXPECT_FALSE(flips("", ""));
  EXPECT_FALSE(flips("Scale -1 1 1", ""));
  EXPECT_TRUE(flips("ReverseOrientation", ""));
  EXPECT_TRUE(flips("ReverseOrientation\nScale -1 1 1", ""));
  EXPECT_FALSE(flips("Scale -1 1 1", normals));
  EXPECT_TRUE(flips("ReverseOrientation\nScale -1 1 1", normals));
}

// Claim: film, filter, sampler, integrator and camera are taken over with pbrt's defaults; the exposure of
// the film scales the lights.
TEST(DescriptionPbrt, OptionsAreTakenOver) {
  const auto plain = read_pbrt("WorldBegin");
  ASSERT_TRUE(plain.ok()) << outcome_of(plain);
  const Object& scene = *plain->description.scene;
  EXPECT_EQ(scene.children_of("integrator").at(0)->plugin, "path");
  EXPECT_EQ(scene.children_of("integrator").at(0)->get_integer("max_depth", 0), 6);
  const ObjectPtr sensor = scene.children_of("sensor").at(0);
  EXPECT_EQ(sensor->plugin, "perspective");
  EXPECT_EQ(sensor->get_number("fov", 0), 90);
  EXPECT_EQ(sensor->get_string("fov_axis", ""), "y");
  EXPECT_EQ(sensor->children_of("film").at(0)->get_integer("width", 0), 1280);
  EXPECT_EQ(sensor->children_of("film").at(0)->get_integer("height", 0), 720);
  EXPECT_EQ(sensor->children_of("sampler").at(0)->get_integer("sample_count", 0), 16);
  EXPECT_EQ(sensor->children_of("film").at(0)->children_of("rfilter").at(0)->plugin, "gaussian");

  const auto full = read_pbrt(
      "Film \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" 200 \"float iso\" 50\n"
      "PixelFilter \"triangle\" \"float xradius\" 1.5 \"float yradius\" 1.5\nIntegrator \"bdpt\" \"integer "
      "maxdepth\" 3\n"
      "Sampler \"stratified\" \"integer xsamples\" 3 \"integer ysamples\" 5\n"
      "Scale 2 2 2\nCamera \"perspective\" \"float fov\" 30 \"float lensradius\" .5 \"float focaldistance\" "
      "6 \"float shutteropen\" 1 \"float shutterclose\" 5\n"
      "WorldBegin\nLightSource \"infinite\"");
  ASSERT_TRUE(full.ok()) << outcome_of(full);
  const Object& other = *full->description.scene;
  EXPECT_EQ(other.children_of("integrator").at(0)->plugin, "bdpt");
  EXPECT_EQ(other.children_of("integrator").at(0)->get_integer("max_depth", 0), 4);
  const ObjectPtr lens = other.children_of("sensor").at(0);
  EXPECT_EQ(lens->plugin, "thinlens");
  EXPECT_EQ(lens->get_string("fov_axis", ""), "x");
  EXPECT_EQ(lens->get_number("aperture_radius", 0),
            0.25);  // the world is half as large as the camera's space
  EXPECT_EQ(lens->get_number("focus_distance", 0), 3);
  EXPECT_EQ(lens->children_of("sampler").at(0)->get_integer("sample_count", 0), 15);
  EXPECT_EQ(lens->children_of("film").at(0)->children_of("rfilter").at(0)->get_number("radius", 0), 1.5);
  EXPECT_EQ(other.children_of("emitter").at(0)->get_rgb("radiance")->value, (Vec3{2, 2, 2}));
}

// Claim: colors of other color spaces and black bodies of unit luminance become linear Rec.709.
TEST(DescriptionPbrt, SpectraBecomeColors) {
  const auto radiance = [](const std::string& light) {
    const auto read = read_pbrt("WorldBegin\n" + light);
    EXPECT_TRUE(read.ok()) << outcome_of(read);
    return read.ok() ? read->description.scene->children_of("emitter").at(0)->get_rgb("radiance")->value
                     : Vec3{};
  };
  const auto luminance = [](const Vec3& c) { return 0.212671 * c[0] + 0.715160 * c[1] + 0.072169 * c[2]; };
  const Vec3 warm = radiance("LightSource \"infinite\" \"blackbody L\" 3000 \"float scale\" 5");
  EXPECT_NEAR(luminance(warm), 5, 1e-6);
  EXPECT_GT(warm[0], 3 * warm[2]);
  const Vec3 flat = radiance("LightSource \"infinite\" \"spectrum L\" [300 7 900 7]");
  EXPECT_NEAR(luminance(flat), 1, 1e-3);
  for (const double c : radiance("LightSource \"infinite\" \"spectrum L\" \"stdillum-D65\""))
    EXPECT_NEAR(c, 1, 1e-4);
  for (const char* space : {"srgb", "rec2020", "dci-p3", "aces2065-1"})
    for (const double c :
         radiance(fmt::format("ColorSpace \"{}\"\nLightSource \"infinite\" \"rgb L\" [1 1 1]", space)))
      EXPECT_NEAR(c, 1, 2e-3) << space;
  const Vec3 green = radiance("ColorSpace \"rec2020\"\nLightSource \"infinite\" \"rgb L\" [.5 1 .5]");
  EXPECT_NEAR(green[1], 1.1329 - 0.5 * (0.12455 + 0.00835), 1e-3);
}

}  // namespace
}  // namespace candela::description
