// Claim: six scenes written for pbrt and in XML have the same film, bit for bit: the readers mean the same.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/unit/pbrt_pictures.h"

namespace candela::test {
namespace {

struct Twin {
  const char* name;
  std::string pbrt, xml;  // worlds
  std::string integrator = "path";
};

const std::string kQuad = R"(ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
-2 -1 -2
2 -1 -2
2 -1 2
-2 -1 2
3 0 2 1
3 0 3 2
)";

const std::string kRoof = R"(ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float nx
property float ny
property float nz
property float u
property float v
element face 2
property list uchar int vertex_indices
end_header
-0.5 -0.5 0 -0.6 0 -0.8 0 0
0.5 -0.5 0 0.6 0 -0.8 1 0
0.5 0.5 0 0.6 0 -0.8 1 1
-0.5 0.5 0 -0.6 0 -0.8 0 1
3 0 2 1
3 0 3 2
)";

// 2 x 2 pixels, rows from the bottom.
std::string picture_file() {
  const float pixels[12] = {0.1f, 0.2f, 0.9f, 0.8f, 0.3f, 0.2f, 0.4f, 0.9f, 0.1f, 0.5f, 0.5f, 0.7f};
  std::string bytes(sizeof(pixels), '\0');
  std::memcpy(bytes.data(), pixels, sizeof(pixels));
  return "PF\n2 2\n-1.0\n" + bytes;
}

std::string pbrt_scene(const std::string& world) {
  return "Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 16\n"
         "LookAt 0 0 -4  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\nWorldBegin\n" +
         world;
}
std::string xml_scene(const std::string& world) {
  return "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='40'/><string "
         "name='fov_axis' value='y'/><float name='near_clip' value='1e-6'/><float name='far_clip' "
         "value='1e12'/><transform name='to_world'><scale x='-1'/><lookat origin='0,0,-4' target='0,0,0' "
         "up='0,1,0'/></transform></sensor>" +
         world + "</scene>";
}

// A sphere of pbrt: v from the bottom.
std::string xml_sphere(const std::string& radius, const std::string& place, const std::string& inside) {
  return "<shape type='sphere'><float name='radius' value='" + radius +
         "'/><transform name='to_world'><scale z='-1'/><translate value='" + place + "'/></transform>" +
         inside + "</shape>";
}
std::string xml_twosided(const std::string& bsdf) {
  return "<bsdf type='twosided'>" + bsdf + "</bsdf>";
}
std::string xml_diffuse(const std::string& rgb) {
  return xml_twosided("<bsdf type='diffuse'><rgb name='reflectance' value='" + rgb + "'/></bsdf>");
}
std::string xml_ply(const std::string& file, const std::string& inside) {
  return "<shape type='ply'><string name='filename' value='" + file + "'/>" + inside + "</shape>";
}

const std::string kPbrtFloor =
    "Shape \"trianglemesh\" \"point3 P\" [-2 -1 -2  2 -1 -2  2 -1 2  -2 -1 2] \"integer indices\" [0 2 1 0 3 "
    "2]\n";
std::string xml_floor(const std::string& bsdf) {
  return xml_ply("quad.ply", "<boolean name='face_normals' value='true'/>" + bsdf);
}

std::vector<Twin> twins() {
  const std::string flip_v = "<matrix value='1 0 0 0 0 -1 0 1 0 0 1 0 0 0 0 1'/>";
  return {
      {"lamps and triangles",
       "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [5 4 3]\nTranslate 0 1 0\n"
       "Shape \"sphere\" \"float radius\" .25\nAttributeEnd\n"
       "Material \"diffuse\" \"rgb reflectance\" [.7 .5 .3]\n" +
           kPbrtFloor,
       xml_sphere(
           "0.25", "0,1,0",
           xml_diffuse(".5,.5,.5") + "<emitter type='area'><rgb name='radiance' value='5,4,3'/></emitter>") +
           xml_floor(xml_diffuse(".7,.5,.3"))},
      {"glass, metal and a sky",
       "LightSource \"infinite\" \"rgb L\" [.3 .4 .5]\n"
       "Material \"dielectric\" \"float eta\" 1.25\nTranslate -.7 0 0\nShape \"sphere\" \"float radius\" .6\n"
       "Material \"conductor\" \"rgb eta\" [.2 .9 1.1] \"rgb k\" [3.9 2.4 2.1] \"float roughness\" .25 "
       "\"bool "
       "remaproughness\" false\nTranslate 1.4 0 0\nShape \"sphere\" \"float radius\" .6\n",
       "<emitter type='constant'><rgb name='radiance' value='.3,.4,.5'/></emitter>" +
           xml_sphere("0.6", "-0.7,0,0",
                      "<bsdf type='dielectric'><float name='int_ior' value='1.25'/><float name='ext_ior' "
                      "value='1'/></bsdf>") +
           xml_sphere(
               "0.6", "0.7,0,0",
               xml_twosided("<bsdf type='roughconductor'><rgb name='eta' value='.2,.9,1.1'/><rgb name='k' "
                            "value='3.9,2.4,2.1'/><string name='distribution' value='ggx'/><float "
                            "name='alpha' value='0.25'/></bsdf>"))},
      {"fog and a point light",
       "LightSource \"point\" \"rgb I\" [9 8 7] \"point3 from\" [0 2 -1]\n"
       "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [.5 .25 .5] \"rgb sigma_s\" "
       "[1.5 "
       ".75 .5] \"float g\" .5\n"
       "AttributeBegin\nMediumInterface \"fog\" \"\"\nMaterial \"interface\"\nShape "
       "\"sphere\"\nAttributeEnd\n" +
           kPbrtFloor,
       "<emitter type='point'><rgb name='intensity' value='9,8,7'/><point name='position' "
       "value='0,2,-1'/></emitter>" +
           xml_sphere(
               "1", "0,0,0",
               "<bsdf type='null'/><medium name='interior' type='homogeneous'><rgb name='sigma_t' "
               "value='2,1,1'/><rgb name='albedo' value='.75,.75,.5'/><phase type='hg'><float name='g' "
               "value='.5'/></phase></medium>") +
           xml_floor(xml_diffuse(".5,.5,.5"))},
      {"textures and holes",
       "LightSource \"distant\" \"rgb L\" [2 2 2] \"point3 from\" [0 1 -2] \"point3 to\" [0 0 0]\n"
       "LightSource \"infinite\" \"rgb L\" [.5 .5 .5]\n"
       "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" 8 \"float vscale\" 4 \"rgb tex1\" [.9 "
       ".8 .7] "
       "\"rgb tex2\" [.1 .2 .3]\n"
       "Texture \"p\" \"spectrum\" \"imagemap\" \"string filename\" \"picture.pfm\"\n"
       "Texture \"m\" \"spectrum\" \"mix\" \"texture tex1\" \"c\" \"texture tex2\" \"p\" \"float amount\" "
       ".25\n"
       "Material \"diffuse\" \"texture reflectance\" \"c\"\nShape \"sphere\" \"float radius\" .7 \"float "
       "alpha\" "
       ".75\n"
       "Material \"conductor\" \"texture reflectance\" \"p\"\nTranslate .5 0 1\nShape \"plymesh\" \"string "
       "filename\" \"roof.ply\"\n"
       "Material \"diffusetransmission\" \"rgb reflectance\" [.5 .25 0] \"rgb transmittance\" [.25 .25 "
       ".5]\nTranslate -1.5 0 -1.5\nShape \"plymesh\" \"string filename\" \"roof.ply\"\n",
       "<emitter type='directional'><rgb name='irradiance' value='2,2,2'/><vector name='direction' "
       "value='0,-1,2'/></emitter><emitter type='constant'><rgb name='radiance' "
       "value='.5,.5,.5'/></emitter>" +
           xml_sphere(
               "0.7", "0,0,0",
               "<bsdf type='mask'><float name='opacity' value='.75'/>" +
                   xml_twosided("<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'>"
                                "<transform name='to_uv'><scale x='4' y='2'/></transform><rgb name='color0' "
                                "value='.9,.8,.7'/><rgb name='color1' value='.1,.2,.3'/></texture></bsdf>") +
                   "</bsdf>") +
           xml_ply("roof.ply",
                   "<transform name='to_world'><translate value='.5,0,1'/></transform>" +
                       xml_twosided("<bsdf type='conductor'><string name='material' value='none'/><texture "
                                    "name='specular_reflectance' type='bitmap'><string name='filename' "
                                    "value='picture.pfm'/><transform name='to_uv'>" +
                                    flip_v + "</transform></texture></bsdf>")) +
           xml_ply(
               "roof.ply",
               "<transform name='to_world'><translate value='-1,0,-.5'/></transform><bsdf type='difftrans'>"
               "<rgb name='reflectance' value='.5,.25,0'/><rgb name='transmittance' "
               "value='.25,.25,.5'/></bsdf>")},
      {"objects and instances",
       "LightSource \"distant\" \"rgb L\" [10 20 30] \"point3 from\" [1 1 -1] \"point3 to\" [0 0 0]\n"
       "ObjectBegin \"o\"\nMaterial \"coateddiffuse\" \"rgb reflectance\" [.2 .5 .8] \"float roughness\" 0\n"
       "Shape \"plymesh\" \"string filename\" \"roof.ply\"\nObjectEnd\n"
       "AttributeBegin\nTranslate .75 0 0\nObjectInstance \"o\"\nAttributeEnd\n"
       "Translate -.75 0 0\nScale 1 2 1\nObjectInstance \"o\"\n",
       "<emitter type='directional'><rgb name='irradiance' value='10,20,30'/><vector name='direction' "
       "value='-1,-1,1'/></emitter><shape type='shapegroup' id='o'>" +
           xml_ply(
               "roof.ply",
               xml_twosided("<bsdf type='plastic'><rgb name='diffuse_reflectance' value='.2,.5,.8'/><float "
                            "name='int_ior' value='1.5'/><float name='ext_ior' value='1'/><boolean "
                            "name='nonlinear' value='true'/></bsdf>")) +
           "</shape><shape type='instance'><transform name='to_world'><translate "
           "value='.75,0,0'/></transform><ref "
           "id='o'/></shape><shape type='instance'><transform name='to_world'><scale y='2'/><translate "
           "value='-.75,0,0'/></transform><ref id='o'/></shape>"},
      {"a mirrored lamp, from the light's side",
       "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [5 5 5]\nTranslate 0 1.5 0\nRotate 90 1 0 0\n"
       "ReverseOrientation\nShape \"disk\" \"float radius\" .5\nAttributeEnd\n"
       "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [3 2 1]\nTranslate 1 0 "
       "0\nReverseOrientation\nScale "
       "-1 1 1\nShape \"sphere\" \"float radius\" .25\nAttributeEnd\n" +
           kPbrtFloor,
       "<shape type='disk'><boolean name='flip_normals' value='true'/><transform name='to_world'><scale "
       "value='.5'/><rotate x='1' angle='90'/><translate y='1.5'/></transform>" +
           xml_diffuse(".5,.5,.5") +
           "<emitter type='area'><rgb name='radiance' value='5,5,5'/></emitter></shape>"
           "<shape type='sphere'><float name='radius' value='.25'/><transform name='to_world'><scale x='-1' "
           "z='-1'/><translate x='1'/></transform>" +
           xml_diffuse(".5,.5,.5") +
           "<emitter type='area'><rgb name='radiance' value='3,2,1'/></emitter></shape>" +
           xml_floor(xml_diffuse(".5,.5,.5")),
       "bdpt"},
  };
}

TEST(PbrtFilms, AreThoseOfXml) {
  for (const Twin& twin : twins()) {
    const Files files = {{"quad.ply", kQuad},
                         {"roof.ply", kRoof},
                         {"picture.pfm", picture_file()},
                         {"scene.pbrt", pbrt_scene(twin.pbrt)},
                         {"scene.xml", xml_scene(twin.xml)}};
    PictureSettings settings{24, 16, 4, twin.integrator, {}};
    const auto pbrt = try_picture(files, "scene.pbrt", settings);
    const auto xml = try_picture(files, "scene.xml", settings);
    ASSERT_TRUE(pbrt.ok()) << twin.name << ": " << pbrt.error().to_string();
    ASSERT_TRUE(xml.ok()) << twin.name << ": " << xml.error().to_string();
    EXPECT_GT(pbrt->mean(), 0.01) << twin.name;
    std::size_t different = 0;
    for (std::size_t i = 0; i < pbrt->sums.size(); ++i) different += pbrt->sums[i] != xml->sums[i] ? 1 : 0;
    EXPECT_EQ(different, 0U) << twin.name << ": of " << pbrt->sums.size() << " sums, means " << pbrt->mean()
                             << " and " << xml->mean();
  }
}

}  // namespace
}  // namespace candela::test
