// Tests the stand-ins of the lenient reading for unknown plugins, parameters and values, and Mitsuba's less
// common plugins, which every reading understands.
#include <gtest/gtest.h>

#include "common/description/reading.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

const Reading strict_reading;
const Reading lenient_reading{.lenient = true};

Result<ReadScene> read_body(const std::string& version, const std::string& body, const Reading& reading) {
  return read_scene(MemorySource({{"scene.xml", "<scene version='" + version + "'>\n" + body + "\n</scene>"},
                                  {"image.png", "not read here"}}),
                    "scene.xml", {}, reading);
}

// The scene as text, or the error.
std::string scene_of(const Result<ReadScene>& result) {
  return result.ok() ? dump(*result->description.scene) : result.error().to_string();
}

std::string lenient_scene(const std::string& body, const std::string& version = "3.0.0") {
  return scene_of(read_body(version, body, lenient_reading));
}

std::string strict_scene(const std::string& body, const std::string& version = "3.0.0") {
  return scene_of(read_body(version, body, strict_reading));
}

std::string warnings_of(const std::string& body, const std::string& version = "3.0.0") {
  const auto result = read_body(version, body, lenient_reading);
  if (!result.ok()) return result.error().to_string();
  std::string text;
  for (const Note& note : result->passed_over)
    text += std::to_string(note.where.line) + ": " + note.text + "\n";
  return text;
}

// Claim: each unknown plugin is read as the scene that docs/scenes-lenient.md says, which is
// strictly valid; without --lenient it is one error.
TEST(DescriptionLenient, UnknownPluginsAreReplaced) {
  const struct {
    const char* body;
    const char* read_as;
  } cases[] = {
      {"<shape type='Rectangle'/>", "<shape type='rectangle'/>"},
      {"<bsdf type='roughconductor_heitz'><float name='alpha' value='0.3'/><integer name='maxBounces' "
       "value='3'/></bsdf>",
       "<bsdf type='roughconductor'><float name='alpha' value='0.3'/></bsdf>"},
      {"<bsdf type='disneybsdf'><rgb name='baseColor' value='0.2 0.3 0.4'/><float name='eta' value='1.5'/>"
       "<float name='specular' value='0.5'/><float name='specularTransmission' value='0.25'/></bsdf>",
       "<bsdf type='principled'><rgb name='base_color' value='0.2 0.3 0.4'/><float name='eta' value='1.5'/>"
       "<float name='spec_trans' value='0.25'/></bsdf>"},
      {"<bsdf type='simplemicrofacet'><float name='alpha' value='0.2'/><rgb name='diffuseReflectance' "
       "value='0.1'/></bsdf>",
       "<bsdf type='roughplastic'><float name='alpha' value='0.2'/><rgb name='diffuse_reflectance' "
       "value='0.1'/></bsdf>"},
      {"<bsdf type='roughconductorGGX'><float name='alphaU' value='0.1'/><float name='alphaV' value='0.2'/>"
       "<rgb name='R0' value='0.9 0.5 0.1'/></bsdf>",
       "<bsdf type='roughconductor'><float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.2'/>"
       "<rgb name='specular_reflectance' value='0.9 0.5 0.1'/><string name='distribution' value='ggx'/>"
       "</bsdf>"},
      {"<bsdf type='glass'><float name='alpha' value='0.2'/></bsdf>",
       "<bsdf type='roughdielectric'><float name='alpha' value='0.2'/></bsdf>"},
      {"<bsdf type='lacquer'><bsdf type='conductor'/></bsdf>",
       "<bsdf type='mask'><float name='opacity' value='1'/><bsdf type='conductor'/></bsdf>"},
      {"<bsdf type='velvet'><texture name='color' type='bitmap'><string name='filename' "
       "value='image.png'/></texture><texture name='fuzz' type='checkerboard'/></bsdf>",
       "<bsdf type='diffuse'><texture name='reflectance' type='bitmap'><string name='filename' "
       "value='image.png'/></texture></bsdf>"},
      {"<bsdf type='diffuse'><texture name='reflectance' type='marble'/></bsdf>",
       "<bsdf type='diffuse'><texture name='reflectance' type='rawconstant'><float name='value' "
       "value='0.5'/></texture></bsdf>"},
      {"<medium type='homogeneous'><phase type='sggx'><volume name='S' type='constvolume'/></phase></medium>",
       "<medium type='homogeneous'><phase type='isotropic'/></medium>"},
      // Densities of 0, 1 and 2 at cosines of -1, 0 and 1 have the mean cosine 1/3.
      {"<medium type='homogeneous'><phase type='tabphase'><string name='values' value='0, 1, 2'/></phase>"
       "</medium>",
       "<medium type='homogeneous'><phase type='hg'><float name='g' value='0.33333333333333337'/></phase>"
       "</medium>"},
      {"<medium type='homogeneous'><phase type='blendphase'><phase type='hg'/><phase type='isotropic'/>"
       "<volume name='weight' type='gridvolume'><string name='filename' value='image.png'/></volume></phase>"
       "</medium>",
       "<medium type='homogeneous'><phase type='blendphase'><float name='weight' value='0.5'/><phase "
       "type='hg'/><phase type='isotropic'/></phase></medium>"},
      {"<sensor type='fisheye'><float name='fov' value='50'/><film type='streakhdrfilm'><integer "
       "name='width' "
       "value='9'/><float name='exposure_time' value='1'/><rfilter type='box'/><rfilter name='tfilter' "
       "type='tent'/></film></sensor>",
       "<sensor type='perspective'><float name='fov' value='50'/><film type='hdrfilm'><integer name='width' "
       "value='9'/><rfilter type='box'/></film></sensor>"},
      {"<integrator type='guided'><integer name='max_depth' value='5'/><float name='budget' value='1'/>"
       "</integrator>",
       "<integrator type='path'><integer name='max_depth' value='5'/></integrator>"},
      {"<shape type='hair'/><emitter type='moon'/><shape type='cube'/>", "<shape type='cube'/>"},
      {"<shape type='rectangle'><sensor type='fluencemeter'><film type='hdrfilm'/></sensor><transform "
       "name='to_world'><scale value='2'/></transform></shape><shape type='cube'/>",
       "<shape type='rectangle'><transform name='to_world'><scale value='2'/></transform></shape><shape "
       "type='cube'/><sensor type='perspective'><transform name='to_world'><scale value='2'/></transform>"
       "<film type='hdrfilm'/></sensor>"},
      {"<shape type='sphere'><transform name='to_world'><translate x='5'/></transform><emitter type='spot'>"
       "<transform name='to_world'><scale value='2'/></transform></emitter></shape>",
       "<shape type='sphere'><transform name='to_world'><translate x='5'/></transform></shape><emitter "
       "type='spot'><transform name='to_world'><scale value='2'/><translate x='5'/></transform></emitter>"},
      // References to what is left out, or stands in, lead to the same.
      {"<emitter type='moon' id='m'/><shape type='cube'><ref id='m'/></shape>", "<shape type='cube'/>"},
      {"<subsurface type='dipole'/><shape type='cube'/>", "<shape type='cube'/>"},
  };
  for (const auto& test : cases) {
    EXPECT_EQ(lenient_scene(test.body), strict_scene(test.read_as)) << test.body;
    EXPECT_FALSE(read_body("3.0.0", test.body, strict_reading).ok()) << test.body;
    EXPECT_TRUE(read_body("3.0.0", test.read_as, strict_reading).ok()) << strict_scene(test.read_as);
  }
}

// Claim: five plugins of Mitsuba's are read as one that gives the same picture but for what the warning says,
// by every reading and in files of every version; what the new plugin lacks is passed over.
TEST(DescriptionLenient, ClosePluginsStandInForEveryReading) {
  const struct {
    const char* body;
    const char* read_as;
    const char* warning;
  } cases[] = {
      {"<bsdf type='polarizer'><spectrum name='theta' value='30'/></bsdf>",
       "<bsdf type='thindielectric'><float name='int_ior' value='1'/><float name='ext_ior' value='1'/>"
       "<rgb name='specular_transmittance' value='0.5'/></bsdf>",
       "bsdf 'polarizer' is not supported yet: it is read as 'thindielectric'"},
      {"<emitter type='collimated'><rgb name='power' value='0 5.980697163503e-5 0'/></emitter>",
       "<emitter type='spot'><rgb name='intensity' value='0 1 0'/><float name='cutoff_angle' value='0.25'/>"
       "<float name='beam_width' value='0.25'/></emitter>",
       "emitter 'collimated' is not supported yet: it is read as 'spot'"},
      {"<sensor type='radiancemeter'><point name='origin' value='1 2 3'/><vector name='direction' "
       "value='0 0 1'/></sensor>",
       "<sensor type='orthographic'><transform name='to_world'><scale x='1e-4' y='1e-4'/><lookat "
       "origin='1 2 3' target='1 2 4'/></transform></sensor>",
       "sensor 'radiancemeter' is not supported yet: it is read as 'orthographic'"},
      {"<bsdf type='pplastic'><float name='alpha' value='0.2'/><rgb name='diffuse_reflectance' "
       "value='0.1'/></bsdf>",
       "<bsdf type='roughplastic'><float name='alpha' value='0.2'/><rgb name='diffuse_reflectance' "
       "value='0.1'/></bsdf>",
       "bsdf 'pplastic' is not supported yet: it is read as 'roughplastic'"},
      {"<medium type='heterogeneous'><phase type='microflake'><float name='stddev' value='0.1'/></phase>"
       "</medium>",
       "<medium type='heterogeneous'><phase type='isotropic'/></medium>",
       "phase 'microflake' is not supported yet: it is read as 'isotropic'"},
  };
  for (const auto& test : cases) {
    for (const std::string version : {"3.0.0", "0.6.0"}) {
      EXPECT_EQ(strict_scene(test.body, version), strict_scene(test.read_as, version)) << test.body;
      EXPECT_EQ(lenient_scene(test.body, version), strict_scene(test.read_as, version)) << test.body;
    }
    EXPECT_TRUE(read_body("3.0.0", test.read_as, strict_reading).ok()) << strict_scene(test.read_as);
    const auto strict = read_body("3.0.0", test.body, strict_reading);
    ASSERT_TRUE(strict.ok());
    ASSERT_FALSE(strict->passed_over.empty());
    EXPECT_NE(strict->passed_over[0].text.find(test.warning), std::string::npos)
        << strict->passed_over[0].text;
  }
}

// Claim: a weight of phase functions that is a constant volume is that number, for every reading.
TEST(DescriptionLenient, ConstantWeightOfPhases) {
  const std::string parts = "<phase type='hg'/><phase type='isotropic'/></phase></medium>";
  const std::string number =
      "<medium type='homogeneous'><phase type='blendphase'><float name='weight' value='0.25'/>" + parts;
  const std::string volume =
      "<medium type='homogeneous'><phase type='blendphase'><volume name='weight' type='constvolume'><float "
      "name='value' value='0.25'/></volume>" +
      parts;
  EXPECT_EQ(strict_scene(volume), strict_scene(number));
  EXPECT_EQ(lenient_scene(volume), strict_scene(number));
  EXPECT_FALSE(read_body("3.0.0",
                         "<medium type='homogeneous'><phase type='blendphase'><volume name='weight' "
                         "type='constvolume'><float name='value' value='2'/></volume>" +
                             parts,
                         lenient_reading)
                   .ok());
}

// Claim: an integrator of Mitsuba that Candela lacks is kept strictly, for the command line may choose
// another; the lenient reading takes the nearest.
TEST(DescriptionLenient, NearestIntegrator) {
  const std::string mapper =
      "<integrator type='photonmapper'><integer name='max_depth' value='5'/></integrator>";
  EXPECT_EQ(lenient_scene(mapper),
            strict_scene("<integrator type='ppm'><integer name='max_depth' value='5'/></integrator>"));
  EXPECT_NE(strict_scene(mapper).find("photonmapper"), std::string::npos);
}

// Claim: the warnings name what is unknown, where, and what takes its place.
TEST(DescriptionLenient, WarningsNameBoth) {
  EXPECT_EQ(
      warnings_of("<bsdf type='velvet'>\n<rgb name='color' value='0.3'/>\n<float name='fuzz' value='1'/>"
                  "</bsdf>"),
      "2: unknown bsdf 'velvet': it is read as 'diffuse'\n"
      "3: bsdf 'diffuse' has no parameter 'color': it is read as 'reflectance'\n"
      "4: bsdf 'diffuse' has no parameter 'fuzz': it is passed over (it has 'reflectance')\n");
  EXPECT_EQ(warnings_of("<emitter type='moon'/>"), "2: unknown emitter 'moon': it is left out\n");
  EXPECT_EQ(warnings_of("<shape type='hair'/>"), "2: shape 'hair' is not supported yet: it is left out\n");
  EXPECT_EQ(warnings_of("<bsdf type='velvet'><rgb name='color' value='2'/></bsdf>"),
            "2: unknown bsdf 'velvet': it is read as 'diffuse'\n"
            "2: bsdf 'diffuse' has no parameter 'color': it is passed over (it has 'reflectance')\n");
}

// Claim: a known plugin's parameter under another name is read as that one, unless its value does not fit; in
// a file before version 2 it means nothing, as in 0.6.
TEST(DescriptionLenient, NearNamesOfParameters) {
  const std::string plastic = "<bsdf type='roughplastic'><rgb name='reflectance' value='0.3'/></bsdf>";
  EXPECT_EQ(lenient_scene(plastic),
            strict_scene("<bsdf type='roughplastic'><rgb name='diffuse_reflectance' value='0.3'/></bsdf>"));
  EXPECT_EQ(lenient_scene(plastic, "0.6.0"), strict_scene("<bsdf type='roughplastic'/>", "0.6.0"));
  EXPECT_EQ(lenient_scene("<shape type='sphere'><transform name='toWorld'><translate x='1'/></transform>"
                          "</shape>"),
            strict_scene("<shape type='sphere'><transform name='to_world'><translate x='1'/></transform>"
                         "</shape>"));
  EXPECT_EQ(lenient_scene("<medium type='homogeneous'><float name='density' value='3'/></medium>"),
            strict_scene("<medium type='homogeneous'><float name='scale' value='3'/></medium>"));
}

// Claim: well-known $parameters have their usual values, unless the scene or the command line gives one.
TEST(DescriptionLenient, UsualValuesOfParameters) {
  const std::string body =
      "<sampler type='independent'><integer name='sample_count' value='$spp'/></sampler>";
  EXPECT_EQ(lenient_scene(body),
            strict_scene("<sampler type='independent'><integer name='sample_count' value='16'/></sampler>"));
  EXPECT_EQ(warnings_of(body), "2: the parameter '$spp' has no value: 16 is assumed\n");
  EXPECT_EQ(strict_scene(body).substr(0, 51), "scene.xml:2: the parameter '$spp' has no value (giv");
  EXPECT_NE(
      lenient_scene("<sampler type='independent'><integer name='sample_count' value='$oddity'/></sampler>")
          .find("'$oddity' has no value"),
      std::string::npos);
  EXPECT_EQ(lenient_scene("<default name='spp' value='3'/>" + body),
            strict_scene("<sampler type='independent'><integer name='sample_count' value='3'/></sampler>"));
}

// Claim: of a parameter given twice the later value counts, which is told, also of a color and a texture.
TEST(DescriptionLenient, LaterValueCounts) {
  const std::string film =
      "<film type='hdrfilm'><integer name='width' value='1'/>\n<integer name='width' value='2'/></film>";
  const std::string once = strict_scene("<film type='hdrfilm'><integer name='width' value='2'/></film>");
  EXPECT_EQ(lenient_scene(film), once);
  EXPECT_EQ(strict_scene(film, "0.6.0"), once);
  EXPECT_EQ(warnings_of(film),
            "3: parameter 'width' of film 'hdrfilm' is given twice, first in line 2: this value counts\n");
  EXPECT_EQ(strict_scene(film), once);
  EXPECT_EQ(strict_scene(film, "2.0.0"), once);
  const std::string color = "<rgb name='reflectance' value='1'/>\n";
  const std::string checks = "<texture type='checkerboard' name='reflectance'/>\n";
  const std::string marks = "<texture type='checkerboard' id='m'/>\n";
  const std::string mark = "<ref id='m' name='reflectance'/>\n";
  const auto diffuse = [](const std::string& body) { return "<bsdf type='diffuse'>" + body + "</bsdf>"; };
  for (const std::string version : {"3.0.0", "0.6.0"}) {
    EXPECT_EQ(strict_scene(diffuse(checks + color), version), strict_scene(diffuse(color), version));
    EXPECT_EQ(strict_scene(diffuse(color + checks), version), strict_scene(diffuse(checks), version));
    EXPECT_EQ(strict_scene(diffuse(color + checks + color), version), strict_scene(diffuse(color), version));
    EXPECT_EQ(strict_scene(marks + diffuse(color + mark), version),
              strict_scene(marks + diffuse(mark), version));
    EXPECT_EQ(strict_scene(marks + diffuse(checks + mark), version),
              strict_scene(marks + diffuse(mark), version));
  }
  EXPECT_EQ(warnings_of(diffuse(checks + color)),
            "2: parameter 'reflectance' of bsdf 'diffuse' is given twice: that of line 3 counts\n");
  EXPECT_EQ(warnings_of(diffuse(color + checks)),
            "2: parameter 'reflectance' of bsdf 'diffuse' is given twice: that of line 3 counts\n");
  EXPECT_EQ(strict_scene("<medium type='homogeneous'><volume name='albedo' type='constvolume'/><float "
                         "name='albedo' value='1'/></medium>"),
            strict_scene("<medium type='homogeneous'><float name='albedo' value='1'/></medium>"));
}

// Claim: a misspelled plugin is the one that the strict error suggests, if it holds as many bsdfs; a name
// that is no misspelling is not.
TEST(DescriptionLenient, TyposAreTheSuggestedPlugin) {
  const struct {
    const char* body;
    const char* read_as;
  } cases[] = {
      {"<bsdf type='roughplastc'><float name='alpha' value='0.2'/></bsdf>",
       "<bsdf type='roughplastic'><float name='alpha' value='0.2'/></bsdf>"},
      {"<bsdf type='condutcor'/>", "<bsdf type='conductor'/>"},
      {"<bsdf type='dieletric'/>", "<bsdf type='dielectric'/>"},
      {"<bsdf type='plast'/>", "<bsdf type='plastic'/>"},
      {"<bsdf type='twsided'><bsdf type='conductor'/></bsdf>",
       "<bsdf type='twosided'><bsdf type='conductor'/></bsdf>"},
      {"<bsdf type='bumpmp'><texture type='checkerboard'/><bsdf type='conductor'/></bsdf>",
       "<bsdf type='bumpmap'><texture type='checkerboard'/><bsdf type='conductor'/></bsdf>"},
      {"<shape type='shpere'><float name='radius' value='2'/></shape>",
       "<shape type='sphere'><float name='radius' value='2'/></shape>"},
      {"<emitter type='poitn'/>", "<emitter type='point'/>"},
      {"<bsdf type='diffuse'><texture name='reflectance' type='chekerboard'/></bsdf>",
       "<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'/></bsdf>"},
      {"<integrator type='bdtp'/>", "<integrator type='bdpt'/>"},
      // Neither is near, or it cannot be.
      {"<bsdf type='wood'/>", "<bsdf type='diffuse'/>"},
      {"<bsdf type='blendbsd'/>", "<bsdf type='diffuse'/>"},
      {"<bsdf type='conductr'><bsdf type='plastic'/></bsdf>",
       "<bsdf type='mask'><float name='opacity' value='1'/><bsdf type='plastic'/></bsdf>"},
      {"<shape type='curve'/><shape type='cube'/>", "<shape type='cube'/>"},
  };
  for (const auto& test : cases) {
    EXPECT_EQ(lenient_scene(test.body), strict_scene(test.read_as)) << test.body;
    EXPECT_FALSE(read_body("3.0.0", test.body, strict_reading).ok()) << test.body;
  }
}

// Claim: a light that is sheared keeps its place and axis under --lenient, and is refused strictly.
TEST(DescriptionLenient, ShearedLightsAreStraightened) {
  for (const std::string plugin : {"spot", "projector"}) {
    const auto light = [&](const std::string& matrix) {
      return "<emitter type='" + plugin + "'><transform name='to_world'><matrix value='" + matrix +
             "'/></transform></emitter>";
    };
    // The columns: x leans towards z, y is stretched, z is -y.
    const std::string sheared = light("1 0 0 5  -0.5 0 -3 6  0 4 0 7  0 0 0 1");
    EXPECT_EQ(lenient_scene(sheared), strict_scene(light("1 0 0 5  0 0 -1 6  0 1 0 7  0 0 0 1"))) << plugin;
    EXPECT_NE(strict_scene(sheared).find("light must not shear, stretch or flatten"), std::string::npos);
    EXPECT_EQ(warnings_of(sheared),
              "2: the to_world of emitter '" + plugin + "' shears or stretches it: its axis counts\n");
    // Scaled alike is no shear; so is a mirror.
    for (const std::string fine :
         {"2 0 0 0  0 2 0 0  0 0 2 0  0 0 0 1", "-1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1"})
      EXPECT_EQ(lenient_scene(light(fine)), strict_scene(light(fine)));
  }
}

// Claim: a rotation without an axis is none under --lenient, and everywhere if its angle is 0.
TEST(DescriptionLenient, RotationWithoutAxis) {
  const auto rotated = [](const std::string& angle) {
    return "<shape type='cube'><transform name='to_world'><rotate angle='" + angle +
           "'/></transform></shape>";
  };
  const std::string unmoved = strict_scene("<shape type='cube'><transform name='to_world'/></shape>");
  EXPECT_EQ(lenient_scene(rotated("30")), unmoved);
  EXPECT_EQ(strict_scene(rotated("0")), unmoved);
  EXPECT_NE(strict_scene(rotated("30")).find("has no length"), std::string::npos);
}

// Claim: strictly too, 'direct' is a path tracer of direct light, integrators around another give way to it,
// a spectrum whose plugin is a texture is that texture, and the films of 0.6 are images.
TEST(DescriptionLenient, WhatEveryReadingUnderstands) {
  const struct {
    const char* body;
    const char* read_as;
  } cases[] = {
      {"<integrator type='direct'><integer name='emitter_samples' value='4'/><boolean name='hide_emitters' "
       "value='true'/></integrator>",
       "<integrator type='path'><boolean name='hide_emitters' value='true'/><integer name='max_depth' "
       "value='2'/></integrator>"},
      {"<integrator type='aov'><string name='aovs' value='d:depth'/><integrator type='path'><integer "
       "name='max_depth' value='5'/></integrator></integrator>",
       "<integrator type='path'><integer name='max_depth' value='5'/></integrator>"},
      {"<integrator type='moment'><integrator type='aov'><integrator type='bdpt'/></integrator></integrator>",
       "<integrator type='bdpt'/>"},
      {"<bsdf type='diffuse'><spectrum name='reflectance' type='bitmap'><string name='filename' "
       "value='image.png'/></spectrum></bsdf>",
       "<bsdf type='diffuse'><texture name='reflectance' type='bitmap'><string name='filename' "
       "value='image.png'/></texture></bsdf>"},
      {"<film type='mfilm'><integer name='height' value='3'/><string name='variable' value='x'/></film>",
       "<film type='hdrfilm'><integer name='height' value='3'/><integer name='width' value='1'/></film>"},
      {"<film type='ldrfilm'><float name='gamma' value='2.2'/></film>", "<film type='hdrfilm'/>"},
      {"<bsdf type='conductor'><rgb name='eta' value='0.2 -0.04 1'/><rgb name='k' value='1 2 3'/></bsdf>",
       "<bsdf type='conductor'><rgb name='eta' value='0.2 0 1'/><rgb name='k' value='1 2 3'/></bsdf>"},
  };
  for (const auto& test : cases) {
    EXPECT_EQ(strict_scene(test.body), strict_scene(test.read_as)) << test.body;
    EXPECT_EQ(lenient_scene(test.body), strict_scene(test.read_as)) << test.body;
    EXPECT_TRUE(read_body("3.0.0", test.read_as, strict_reading).ok()) << strict_scene(test.read_as);
  }
  // An area emitter beside the shapes glows in those that refer to it.
  const auto result = read_body(
      "3.0.0", "<emitter type='area' id='glow'/><shape type='cube'><ref id='glow'/></shape>", strict_reading);
  ASSERT_TRUE(result.ok()) << result.error().to_string();
  EXPECT_EQ(result->description.scene->children_of("shape").at(0)->children_of("emitter").size(), 1U);
}

// Claim: what 0.6 documents and later versions lack is read in files before version 2.
TEST(DescriptionLenient, OldFiles) {
  const struct {
    const char* body;
    const char* read_as;
  } cases[] = {
      {"<medium type='homogeneous'/>",
       "<medium type='homogeneous'><string name='material' value='skin1'/></medium>"},
      {"<bsdf type='roughplastic'><string name='distribution' value='as'/></bsdf>",
       "<bsdf type='roughplastic'><string name='distribution' value='beckmann'/></bsdf>"},
      {"<bsdf type='normalmap'><string name='filename' value='image.png'/><bsdf type='diffuse'/></bsdf>",
       "<bsdf type='normalmap'><bsdf type='diffuse'/><texture name='normalmap' type='bitmap'><string "
       "name='filename' value='image.png'/><boolean name='raw' value='true'/></texture></bsdf>"},
      {"<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'><float name='uvscale' "
       "value='4'/><float name='vscale' value='3'/></texture></bsdf>",
       "<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'><float name='uscale' "
       "value='4'/><float name='vscale' value='3'/></texture></bsdf>"},
      // Media begin at the camera.
      {"<medium type='homogeneous' id='m'/><sensor type='perspective'><float name='nearClip' value='3'/><ref "
       "id='m'/></sensor>",
       "<medium type='homogeneous' id='m'/><sensor type='perspective'><float name='nearClip' "
       "value='1e-6'/><ref "
       "id='m'/></sensor>"},
  };
  for (const auto& test : cases) {
    EXPECT_EQ(strict_scene(test.body, "0.6.0"), strict_scene(test.read_as, "0.6.0")) << test.body;
    EXPECT_EQ(lenient_scene(test.body, "0.6.0"), strict_scene(test.read_as, "0.6.0")) << test.body;
    EXPECT_TRUE(read_body("0.6.0", test.read_as, strict_reading).ok());
  }
  const std::string later =
      "<medium type='homogeneous' id='m'/><sensor type='perspective'><float name='near_clip' value='3'/><ref "
      "id='m'/></sensor>";
  EXPECT_NE(strict_scene(later).find("near_clip"), std::string::npos);
  EXPECT_EQ(strict_scene(later).find("1e-06"), std::string::npos);
}

}  // namespace
}  // namespace candela::description
