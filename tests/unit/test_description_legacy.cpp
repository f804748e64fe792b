// Files before version 2: what each old word becomes. (Conductors and spectra have their own tests.)
#include <gtest/gtest.h>

#include <array>

#include "common/description/media_presets.h"
#include "common/description/review.h"
#include "common/description/text.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

std::string in_scene(const std::string& body, const std::string& version) {
  return "<scene version='" + version + "'>" + body + "</scene>";
}

// The graphs as text.
std::string old_graph(const std::string& body) {
  const auto result = parse_text(in_scene(body, "0.6.0"));
  return result.ok() ? dump(*result->scene) : outcome(result);
}
std::string new_graph(const std::string& body) {
  const auto result = parse_text(in_scene(body, "3.0.0"));
  return result.ok() ? dump(*result->scene) : outcome(result);
}
std::string refusal(const std::string& body) {
  return outcome(parse_text(in_scene(body, "0.6.0")));
}

// Claim: each old object is today's object.
TEST(DescriptionLegacy, OldWordsAreTodaysObjects) {
  const struct {
    std::string was, is;
  } cases[] = {
      {"<bsdf type='mask'><float name='opacity' value='0.3'/><bsdf type='diffuse'/></bsdf>",
       "<bsdf type='mask'><float name='opacity' value='0.3'/><bsdf type='diffuse'/></bsdf>"},
      {"<bsdf type='mask'><spectrum name='opacity' value='0.3'/><bsdf type='diffuse'/></bsdf>",
       "<bsdf type='mask'><rgb name='opacity' value='0.3'/><bsdf type='diffuse'/></bsdf>"},
      {"<bsdf type='mixturebsdf'><string name='weights' value='0.25, 0.75'/><bsdf type='diffuse'/>"
       "<bsdf type='dielectric'/></bsdf>",
       "<bsdf type='blendbsdf'><float name='weight' value='0.75'/><bsdf type='diffuse'/>"
       "<bsdf type='dielectric'/></bsdf>"},
      {"<bsdf type='mixturebsdf'><string name='weights' value='0.5 0.25 0.25'/><bsdf type='diffuse'/>"
       "<bsdf type='dielectric'/><bsdf type='null'/></bsdf>",
       "<bsdf type='blendbsdf'><float name='weight' value='0.5'/><bsdf type='diffuse'/>"
       "<bsdf type='blendbsdf'><float name='weight' value='0.5'/><bsdf type='dielectric'/><bsdf "
       "type='null'/></bsdf>"
       "</bsdf>"},
      {"<bsdf type='mixturebsdf'><string name='weights' value='0.25, 0.25'/><bsdf type='dielectric'/>"
       "<bsdf type='null'/></bsdf>",
       "<bsdf type='blendbsdf'><float name='weight' value='0.75'/><bsdf type='dielectric'/>"
       "<bsdf type='blendbsdf'><float name='weight' value='0.6666666666666666'/><bsdf type='null'/>"
       "<bsdf type='diffuse'><rgb name='reflectance' value='0'/></bsdf></bsdf></bsdf>"},
      {"<bsdf type='mixturebsdf'><string name='weights' value='3, 1'/><bsdf type='dielectric'/><bsdf "
       "type='null'/>"
       "</bsdf>",
       "<bsdf type='blendbsdf'><float name='weight' value='0.25'/><bsdf type='dielectric'/><bsdf "
       "type='null'/>"
       "</bsdf>"},
      {"<medium type='homogeneous'><float name='sigmaT' value='1'/><float name='albedo' value='0.5'/><phase "
       "type='mixturephase'><string "
       "name='weights' value='1, 2, 1'/><phase type='hg'/><phase type='isotropic'/><phase type='rayleigh'/>"
       "</phase></medium>",
       "<medium type='homogeneous'><float name='sigma_t' value='1'/><float name='albedo' value='0.5'/><phase "
       "type='blendphase'><float "
       "name='weight' value='0.75'/><phase type='hg'/><phase type='blendphase'><float name='weight' "
       "value='0.3333333333333333'/><phase type='isotropic'/><phase "
       "type='rayleigh'/></phase></phase></medium>"},
      {"<bsdf type='diffuse'><texture type='vertexcolors' name='reflectance'/></bsdf>",
       "<bsdf type='diffuse'><texture type='mesh_attribute' name='reflectance'><string name='name' "
       "value='vertex_color'/></texture></bsdf>"},
      {"<bsdf type='diffuse'><texture type='gridtexture' name='reflectance'><float name='lineWidth' "
       "value='0.1'/><float name='uscale' value='4'/></texture></bsdf>",
       "<bsdf type='diffuse'><texture type='gridtexture' name='reflectance'><float name='line_width' "
       "value='0.1'/><transform name='to_uv'><scale x='4'/></transform></texture></bsdf>"},
      {"<shape type='ply'><string name='filename' value='mesh.obj'/></shape>",
       "<shape type='ply'><string name='filename' value='mesh.obj'/><boolean name='srgb' value='true'/>"
       "</shape>"},
      {"<shape type='cylinder'><point name='p0' value='1 0 0'/><point name='p1' value='0 0 2'/><boolean "
       "name='flipNormals' "
       "value='true'/></shape>",
       "<shape type='cylinder'><point name='p0' value='1 0 0'/><point name='p1' value='0 0 2'/><boolean "
       "name='flip_normals' "
       "value='true'/></shape>"},
      {"<shape type='disk'><transform name='toWorld'><scale value='2'/></transform></shape>",
       "<shape type='disk'><transform name='to_world'><scale value='2'/></transform></shape>"},
      {"<sensor type='thinlens'><float name='apertureRadius' value='0.1'/><float name='focusDistance' "
       "value='3'/>"
       "</sensor>",
       "<sensor type='thinlens'><float name='aperture_radius' value='0.1'/><float name='focus_distance' "
       "value='3'/>"
       "</sensor>"},
      {"<sensor type='orthographic'><float name='nearClip' value='1'/></sensor>",
       "<sensor type='orthographic'><float name='near_clip' value='1'/></sensor>"},
      {"<sensor type='perspective'><sampler type='sobol'><integer name='sampleCount' value='64'/>"
       "<integer name='scramble' value='1'/></sampler></sensor>",
       "<sensor type='perspective'><sampler type='sobol'><integer name='sample_count' value='64'/>"
       "<integer name='scramble' value='1'/></sampler></sensor>"},
      {"<emitter type='envmap'><string name='filename' value='image.png'/><float name='scale' value='2'/>"
       "<float name='samplingWeight' value='3'/></emitter>",
       "<emitter type='envmap'><string name='filename' value='image.png'/><float name='scale' value='2'/>"
       "<float name='sampling_weight' value='3'/></emitter>"},
      {"<texture type='scale'><float name='scale' value='2'/><texture type='checkerboard' name='x'>"
       "<float name='uscale' value='4'/></texture></texture>",
       "<texture type='scale'><float name='scale' value='2'/><texture type='checkerboard' name='x'>"
       "<transform name='to_uv'><scale x='4'/></transform></texture></texture>"},
      {"<medium type='homogeneous'><rgb name='sigmaA' value='1, 0, 0'/><rgb name='sigmaS' value='3, 2, 0'/>"
       "<float name='densityMultiplier' value='5'/><string name='strategy' value='balance'/>"
       "<phase type='hg'><float name='g' value='0.5'/></phase></medium>",
       "<medium type='homogeneous'><float name='scale' value='5'/><rgb name='sigma_t' value='4, 2, 0'/>"
       "<rgb name='albedo' value='0.75, 1, 0'/><phase type='hg'><float name='g' "
       "value='0.5'/></phase></medium>"},
      {"<medium type='homogeneous'><rgb name='sigmaT' value='4'/><rgb name='albedo' value='0.5'/></medium>",
       "<medium type='homogeneous'><rgb name='sigma_t' value='4'/><rgb name='albedo' value='0.5'/></medium>"},
      {"<medium type='heterogeneous'><string name='method' value='woodcock'/><float name='densityMultiplier' "
       "value='7'/><volume type='gridvolume' name='density'><string name='filename' "
       "value='mesh.obj'/></volume>"
       "<volume type='constvolume' name='albedo'><rgb name='value' value='0.9'/></volume></medium>",
       "<medium type='heterogeneous'><float name='scale' value='7'/><volume type='gridvolume' name='sigma_t'>"
       "<string name='filename' value='mesh.obj'/><boolean name='use_grid_bbox' value='true'/></volume>"
       "<volume type='constvolume' name='albedo'><rgb name='value' value='0.9'/></volume></medium>"},
      {"<medium type='heterogeneous'><volume type='gridvolume' name='density'><string name='filename' "
       "value='mesh.obj'/><point name='min' x='1' y='2' z='3'/><point name='max' x='3' y='5' z='7'/>"
       "<transform name='toWorld'><translate x='10'/></transform></volume></medium>",
       "<medium type='heterogeneous'><volume type='gridvolume' name='sigma_t'><string name='filename' "
       "value='mesh.obj'/><transform name='to_world'><scale x='2' y='3' z='4'/><translate x='11' y='2' "
       "z='3'/>"
       "</transform><boolean name='use_grid_bbox' value='false'/></volume></medium>"},
      {"<medium type='heterogeneous'><volume type='gridvolume' name='density'><string name='filename' "
       "value='mesh.obj'/><point name='min' x='1' y='2' z='3'/></volume></medium>",
       "<medium type='heterogeneous'><volume type='gridvolume' name='sigma_t'><string name='filename' "
       "value='mesh.obj'/><boolean name='use_grid_bbox' value='true'/></volume></medium>"},
      {"<emitter type='sunsky'><float name='scale' value='3'/><float name='skyScale' value='2'/></emitter>",
       "<emitter type='sunsky'><float name='sky_scale' value='2'/><rgb name='albedo' value='0.2'/>"
       "<float name='sun_scale' value='3'/></emitter>"},
      {"<emitter type='sky'><spectrum name='albedo' value='0.5'/></emitter>",
       "<emitter type='sky'><rgb name='albedo' value='0.5'/></emitter>"},
      {"<emitter type='sky'/>", "<emitter type='sky'><rgb name='albedo' value='0.2'/></emitter>"},
      {"<emitter type='sun'/>", "<emitter type='sun'/>"},
      {"<bsdf type='roughplastic'><float name='alpha' value='0.3'/></bsdf>",
       "<bsdf type='roughplastic'><float name='alpha' value='0.3'/><string name='masked_light' "
       "value='stays'/></bsdf>"},
      // A medium's own g reduces its scattering.
      {"<medium type='homogeneous'><rgb name='sigmaA' value='4'/><rgb name='sigmaS' value='4'/><float "
       "name='g' value='0.75'/></medium>",
       "<medium type='homogeneous'><rgb name='sigma_t' value='5'/><rgb name='albedo' value='0.2'/></medium>"},
      {"<bsdf type='roughdiffuse'><rgb name='diffuseReflectance' value='0.3'/></bsdf>",
       "<bsdf type='roughdiffuse'><rgb name='reflectance' value='0.3'/></bsdf>"},
      {"<bsdf type='roughdiffuse'><texture name='diffuseReflectance' type='checkerboard'/></bsdf>",
       "<bsdf type='roughdiffuse'><texture name='reflectance' type='checkerboard'/></bsdf>"},
      {"<bsdf type='hk'><texture name='sigmaT' type='checkerboard'/><texture name='albedo' "
       "type='checkerboard'/></bsdf>",
       "<bsdf type='hk'><texture name='sigma_t' type='checkerboard'/><texture name='albedo' "
       "type='checkerboard'/></bsdf>"},
      {"<bsdf type='diffuse'><rgb name='reflectance' value='#ff0033' intent='reflectance'/></bsdf>",
       "<bsdf type='diffuse'><rgb name='reflectance' value='1, 0, 0.2'/></bsdf>"},
      {"<bsdf type='diffuse'><srgb name='reflectance' value='#ff8000' intent='illuminant'/></bsdf>",
       "<bsdf type='diffuse'><srgb name='reflectance' value='#ff8000'/></bsdf>"},
      {"<bsdf type='diffuse'><spectrum name='reflectance' value='0.1, 0.2, 0.3'/></bsdf>",
       "<bsdf type='diffuse'><rgb name='reflectance' value='0.1, 0.2, 0.3'/></bsdf>"},
      {"<bsdf type='diffuse'><spectrum name='reflectance' value='400:0.1, 700:0.2'/></bsdf>",
       "<bsdf type='diffuse'><spectrum name='reflectance' value='400:0.1, 700:0.2'/></bsdf>"},
  };
  for (const auto& test : cases) {
    const std::string now = new_graph(test.is);
    EXPECT_TRUE(now.starts_with("(scene")) << now;
    EXPECT_EQ(old_graph(test.was), now) << test.was;
  }
}

// Claim: what has no exact counterpart is refused with the line and, where there is one, the mend.
TEST(DescriptionLegacy, Refusals) {
  const struct {
    std::string body, message;
  } cases[] = {
      {"<bsdf type='mixturebsdf'><bsdf type='diffuse'/></bsdf>",
       "scene.xml:1: bsdf 'mixturebsdf' lacks the string 'weights'"},
      {"<bsdf type='mixturebsdf'><string name='weights' value='1'/><bsdf type='diffuse'/><bsdf "
       "type='null'/></bsdf>",
       "scene.xml:1: bsdf 'mixturebsdf' has 2 bsdfs but 1 weights"},
      {"<bsdf type='mixturebsdf'><string name='weights' value='1, -1'/><bsdf type='diffuse'/><bsdf "
       "type='null'/>"
       "</bsdf>",
       "scene.xml:1: '-1' is no weight of a bsdf"},
      {"<bsdf type='mixturebsdf'><string name='weights' value=''/></bsdf>",
       "scene.xml:1: bsdf 'mixturebsdf' has 0 bsdfs but 0 weights"},
      {"<bsdf type='diffuse'><rgb name='reflectance' value='1' intent='both'/></bsdf>",
       "scene.xml:1: 'both' is not an intent (write 'reflectance' or 'illuminant')"},
      {"<bsdf type='diffuse'><spectrum name='reflectance' value='1 2 3 4'/></bsdf>",
       "scene.xml:1: '1' is not a pair of wavelength and value (write nanometers and value as '550:0.5', "
       "without "
       "spaces inside)"},
      {"<medium type='homogeneous'><string name='material' value='syrup of nobody'/></medium>",
       "scene.xml:1: 'syrup of nobody' is no medium with measured coefficients (there is @)"},
      {"<medium type='homogeneous'><string name='material' value='lowfat mlk'/></medium>",
       "scene.xml:1: 'lowfat mlk' is no medium with measured coefficients (did you mean 'lowfat milk'?)"},
      {"<medium type='homogeneous'><rgb name='sigmaA' value='1'/></medium>",
       "scene.xml:1: 'sigmaA' and 'sigmaS' are only valid together"},
      {"<medium type='homogeneous'><rgb name='sigmaA' value='1'/><rgb name='sigmaS' value='-1'/></medium>",
       "scene.xml:1: parameter 'sigmaS' is -1, but must be at least 0"},
      {"<medium type='homogeneous'><rgb name='sigmaA' value='1'/><rgb name='sigmaS' value='1'/>"
       "<rgb name='albedo' value='1'/></medium>",
       "scene.xml:1: 'albedo' and 'sigmaA', 'sigmaS' exclude each other"},
  };
  for (const auto& test : cases) {
    std::string message = test.message;
    if (const std::size_t at = message.find('@'); at != std::string::npos)
      message.replace(at, 1, text::quoted_list(medium_names()));
    EXPECT_EQ(refusal(test.body), message) << test.body;
  }
  std::string many;
  for (int i = 0; i < 101; ++i) many += "<bsdf type='null'/>";
  EXPECT_EQ(refusal("<bsdf type='mixturebsdf'><string name='weights' value='1'/>" + many + "</bsdf>"),
            "scene.xml:1: bsdf 'mixturebsdf' has 101 bsdfs, more than 100");
}

// Claim: of several sensors of an old file the last is the scene's, of a later file the first.
TEST(DescriptionLegacy, LastSensorCounts) {
  const std::string body =
      "<sensor type='perspective' id='a'/><shape type='cube'/><sensor type='orthographic'/><sensor "
      "type='thinlens'><float name='apertureRadius' value='0'/></sensor><emitter type='point'/>";
  const auto old = parse_text(in_scene(body, "0.6.0"));
  ASSERT_TRUE(old.ok()) << outcome(old);
  std::vector<std::string> plugins;
  for (const ObjectPtr& sensor : old->scene->children_of("sensor")) plugins.push_back(sensor->plugin);
  EXPECT_EQ(plugins, (std::vector<std::string>{"thinlens", "perspective", "orthographic"}));
  const auto now = parse_text(in_scene("<sensor type='perspective'/><sensor type='orthographic'/>", "3.0.0"));
  ASSERT_TRUE(now.ok()) << outcome(now);
  EXPECT_EQ(now->scene->children_of("sensor").at(0)->plugin, "perspective");
}

// Claim: an old scene without a light gets 0.6's sun and sky, which is told; a later one stays black.
TEST(DescriptionLegacy, DarkScenesGetASky) {
  const std::string body = "<sensor type='perspective'/><shape type='cube'/>";
  const auto old = parse_text(in_scene(body, "0.6.0"));
  ASSERT_TRUE(old.ok()) << outcome(old);
  ASSERT_EQ(old->scene->children_of("emitter").size(), 1U);
  const Object& sky = *old->scene->children_of("emitter")[0];
  EXPECT_EQ(sky.plugin, "sunsky");
  EXPECT_EQ(sky.get_number("sun_scale", 1), 2);
  EXPECT_EQ(sky.get_number("sky_scale", 1), 2);
  EXPECT_EQ(sky.get_number("sun_radius_scale", 1), 15);
  ASSERT_EQ(old->notes.size(), 1U);
  EXPECT_EQ(old->notes[0].text,
            "the scene has no light: a sun and a sky are added, as in 0.6, but dark below the horizon");
  const auto lit = parse_text(in_scene(body + "<emitter type='point'/>", "0.6.0"));
  ASSERT_TRUE(lit.ok()) << outcome(lit);
  EXPECT_EQ(lit->scene->children_of("emitter").size(), 1U);
  EXPECT_TRUE(lit->notes.empty());
  const auto lamp = parse_text(
      in_scene("<sensor type='perspective'/><shape type='cube'><emitter type='area'/></shape>", "0.6.0"));
  ASSERT_TRUE(lamp.ok()) << outcome(lamp);
  EXPECT_TRUE(lamp->scene->children_of("emitter").empty());
  const auto now = parse_text(in_scene(body, "3.0.0"));
  ASSERT_TRUE(now.ok()) << outcome(now);
  EXPECT_TRUE(now->scene->children_of("emitter").empty());
}

// Extinction and albedo of an old medium of this name, per channel.
std::array<Vec3, 2> medium_of(const std::string& name) {
  const auto read = parse_text(in_scene(
      "<medium type='homogeneous'><string name='material' value='" + name + "'/></medium>", "0.6.0"));
  EXPECT_TRUE(read.ok()) << outcome(read);
  if (!read.ok()) return {};
  const ObjectPtr medium = read->scene->children_of("medium").at(0);
  return {medium->get_rgb("sigma_t")->value, medium->get_rgb("albedo")->value};
}

// Claim: 0.6's media by Narasimhan et al. scatter as reduced by their mean cosines, in 0.6's unit, a
// hundredth of a millimeter's inverse; names may be in any case of letters, and the misspelled one is known.
TEST(DescriptionLegacy, MediaOfNarasimhan) {
  const auto [extinction, albedo] = medium_of("Lowfat Milk");
  // 0.6's table has scattering 13.1157, 15.4445, 17.9572, absorption 0.00287, 0.00575, 0.0115, cosines 0.932,
  // 0.902, 0.859.
  const Vec3 scattering = {89.187, 151.356, 253.197}, absorption = {0.287, 0.575, 1.15};
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(extinction[c], scattering[c] + absorption[c], 1e-3);
    EXPECT_NEAR(albedo[c] * extinction[c], scattering[c], 1e-3);
  }
  const auto [wine, of_wine] = medium_of("MERLOT");
  EXPECT_NEAR(wine[1], 25.191, 1e-9);  // scatters red alone
  EXPECT_EQ(of_wine[1], 0);
  EXPECT_GT(of_wine[0], 0);
  EXPECT_EQ(medium_of("Budweiser Beder"), medium_of("budweiser beer"));
  EXPECT_EQ(medium_of("regularmilk"), medium_of("Regular Milk"));
  const auto [skin, of_skin] = medium_of("skin1");
  EXPECT_NEAR(skin[0], 77.2, 1e-9);
  EXPECT_NEAR(of_skin[0], 0.74 / 0.772, 1e-9);
  const auto [ketchup, of_ketchup] = medium_of("Ketchup");
  EXPECT_NEAR(ketchup[2], 148, 1e-9);
  EXPECT_NEAR(of_ketchup[2] * 148, 3, 1e-9);
  // 0.6's own value, a tenth of the paper's.
  EXPECT_NEAR(medium_of("chicken1")[0][0], 15 + 0.15, 1e-9);
  // One that lacks is the default material's.
  const auto half =
      parse_text(in_scene("<medium type='homogeneous'><rgb name='sigmaT' value='2'/></medium>", "0.6.0"));
  ASSERT_TRUE(half.ok()) << outcome(half);
  EXPECT_EQ(half->scene->children_of("medium").at(0)->get_rgb("albedo")->value, of_skin);
  const auto layer =
      parse_text(in_scene("<bsdf type='hk'><string name='material' value='Spectralon'/><float "
                          "name='scale' value='0.5'/></bsdf>",
                          "0.6.0"));
  ASSERT_TRUE(layer.ok()) << outcome(layer);
  EXPECT_NEAR(layer->scene->children_of("bsdf").at(0)->get_rgb("sigma_t")->value[1], 1020, 1e-9);
  EXPECT_EQ(medium_names().size(), 12U + 35U);
  for (const std::string_view name : medium_names()) EXPECT_TRUE(named_medium(name)) << name;
}

// Claim: weights above 1 in sum and grids whose values lie elsewhere are told of.
TEST(DescriptionLegacy, ReinterpretationsAreNoted) {
  const auto mixture =
      parse_text(in_scene("<bsdf type='mixturebsdf'><string name='weights' value='3, 1'/><bsdf "
                          "type='diffuse'/><bsdf type='null'/></bsdf>",
                          "0.6.0"));
  ASSERT_TRUE(mixture.ok()) << outcome(mixture);
  ASSERT_EQ(mixture->notes.size(), 1U);
  EXPECT_EQ(mixture->notes[0].text, "the weights' sum 4 is above 1: they are divided by it");
  const auto grid =
      parse_text(in_scene("<medium type='heterogeneous'><volume type='gridvolume' name='density'>"
                          "<string name='filename' value='mesh.obj'/></volume></medium>",
                          "0.6.0"));
  ASSERT_TRUE(grid.ok()) << outcome(grid);
  ASSERT_EQ(grid->notes.size(), 1U);
}

}  // namespace
}  // namespace candela::description
