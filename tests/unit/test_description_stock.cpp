// The plugins that Mitsuba 0.6 and 3 document, each in the smallest scene that has it: the strict reading
// understands it, or the lenient one says what it put in its place. And values that no rule accepts: the
// lenient reading mends them and says so.
#include <gtest/gtest.h>

#include <set>

#include "common/description/vocabulary.h"
#include "smallest_scene.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

struct Documented {
  std::string category;
  std::vector<std::string> plugins;
};

// From the manuals' lists, without polarization ('stokes', 'retarder', 'circular', 'measured_polarized'),
// what needs wavelengths ('specfilm'), and integrators for derivatives ('prb', ...).
const std::vector<Documented>& documented() {
  static const std::vector<Documented> all = {
      {"shape",
       {"cube", "sphere", "cylinder", "rectangle", "disk", "obj", "ply", "serialized", "shapegroup",
        "instance", "hair", "heightfield", "bsplinecurve", "linearcurve", "sdfgrid", "merge", "ellipsoids",
        "ellipsoidsmesh"}},
      {"bsdf", {"diffuse",      "roughdiffuse",   "dielectric", "thindielectric", "roughdielectric",
                "conductor",    "roughconductor", "plastic",    "roughplastic",   "coating",
                "roughcoating", "bumpmap",        "normalmap",  "phong",          "ward",
                "mixturebsdf",  "blendbsdf",      "mask",       "twosided",       "difftrans",
                "hk",           "irawan",         "null",       "principled",     "principledthin",
                "measured",     "hair",           "pplastic"}},
      {"texture",
       {"bitmap", "checkerboard", "gridtexture", "scale", "vertexcolors", "wireframe", "curvature",
        "mesh_attribute", "volume"}},
      {"medium", {"homogeneous", "heterogeneous"}},
      {"phase",
       {"isotropic", "hg", "rayleigh", "kkay", "microflake", "mixturephase", "blendphase", "sggx",
        "tabphase"}},
      {"volume", {"constvolume", "gridvolume", "volcache", "hgridvolume"}},
      {"emitter",
       {"point", "area", "spot", "directional", "collimated", "sky", "sun", "sunsky", "envmap", "constant",
        "projector", "directionalarea"}},
      {"sensor",
       {"perspective", "thinlens", "orthographic", "telecentric", "spherical", "irradiancemeter",
        "radiancemeter", "fluencemeter", "perspective_rdist", "distant", "batch"}},
      {"integrator",
       {"ao",           "direct", "path",     "volpath_simple", "volpath", "volpathmis", "bdpt",
        "photonmapper", "ppm",    "sppm",     "pssmlt",         "mlt",     "erpt",       "ptracer",
        "adaptive",     "vpl",    "irrcache", "multichannel",   "field",   "depth",      "moment",
        "aov"}},
      {"sampler",
       {"independent", "stratified", "ldsampler", "halton", "hammersley", "sobol", "multijitter",
        "orthogonal"}},
      {"film", {"hdrfilm", "ldrfilm", "mfilm", "tiledhdrfilm"}},
      {"rfilter", {"box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"}}};
  return all;
}

// Claim: no plugin that the manuals document keeps a scene from being read with --lenient, in either
// spelling; what strict reading does not understand is told by its name.
TEST(DescriptionStock, EveryDocumentedPluginIsUnderstoodOrMapped) {
  int understood = 0, mapped = 0;
  for (const Documented& list : documented()) {
    for (const std::string& plugin : list.plugins) {
      const std::string body =
          smallest_scene(list.category, plugin, required_contents(list.category, plugin));
      const bool strict =
          read_smallest("0.6.0", body, false).ok() && find_plugin(list.category, plugin) != nullptr;
      for (const char* version : {"0.6.0", "3.0.0"}) {
        if (std::string(version) == "3.0.0" && plugin == "mixturebsdf") continue;  // 0.6's alone
        const auto read = read_smallest(version, body, true);
        ASSERT_TRUE(read.ok()) << list.category << " " << plugin << ": " << read.error().to_string();
        if (strict) continue;
        bool told = false;
        for (const Note& note : read->description.notes)
          told = told || note.text.find("'" + plugin + "'") != std::string::npos;
        // Other names of what the vocabulary has, and kinds of samplers, which the job chooses.
        static const std::set<std::string> silent = {"direct", "mixturebsdf", "mixturephase", "vertexcolors"};
        told = told || canonical_plugin(list.category, plugin) != plugin || silent.contains(plugin);
        EXPECT_TRUE(told) << list.category << " " << plugin << " is replaced without a word";
      }
      ++(strict ? understood : mapped);
    }
  }
  std::printf("%d documented plugins are understood, %d are mapped with a warning\n", understood, mapped);
  EXPECT_GE(understood, 77);
}

std::string notes_of(const std::string& version, const std::string& body) {
  const auto read = read_smallest(version, body, true);
  if (!read.ok()) return read.error().to_string();
  std::string text;
  for (const Note& note : read->passed_over) text += note.text + "\n";
  return text;
}

std::string scene_text(const std::string& version, const std::string& body, bool lenient) {
  const auto read = read_smallest(version, body, lenient);
  return read.ok() ? dump(*read->description.scene) : read.error().to_string();
}

// Claim: a value out of bounds becomes the nearest within, a color keeps its hue, a value of another type is
// converted if it can be, and what cannot be mended has its default; each with a warning, and none strictly.
TEST(DescriptionStock, ValuesAreMended) {
  const struct {
    const char* version;
    const char* body;
    const char* read_as;
    const char* told;
  } cases[] = {
      {"0.6.0", "<bsdf type='diffuse'><rgb name='reflectance' value='1.6 0.8 0.4'/></bsdf>",
       "<bsdf type='diffuse'><rgb name='reflectance' value='1 0.5 0.25'/></bsdf>",
       "parameter 'reflectance' is 1.6, but must be at most 1: 1, 0.5, 0.25 is taken\n"},
      {"3.0.0", "<bsdf type='diffuse'><rgb name='reflectance' value='-0.5 0.5 1'/></bsdf>",
       "<bsdf type='diffuse'><rgb name='reflectance' value='0 0.5 1'/></bsdf>",
       "parameter 'reflectance' is -0.5, but must be at least 0: 0, 0.5, 1 is taken\n"},
      {"3.0.0", "<bsdf type='roughconductor'><float name='alpha' value='0'/></bsdf>",
       "<bsdf type='roughconductor'><float name='alpha' value='1e-6'/></bsdf>",
       "parameter 'alpha' is 0, but must be above 0: 1e-06 is taken\n"},
      {"3.0.0", "<shape type='sphere'><float name='radius' value='-2'/></shape>",
       "<shape type='sphere'><float name='radius' value='1e-6'/></shape>",
       "parameter 'radius' is -2, but must be above 0: 1e-06 is taken\n"},
      {"3.0.0",
       "<emitter type='spot'><float name='cutoff_angle' value='-5'/><float name='beam_width' "
       "value='0'/></emitter>",
       "<emitter type='spot'><float name='cutoff_angle' value='1e-6'/><float name='beam_width' "
       "value='0'/></emitter>",
       nullptr},
      {"0.6.0",
       "<medium type='homogeneous'><rgb name='sigmaS' value='-1'/><rgb name='sigmaA' value='2'/></medium>",
       "<medium type='homogeneous'><rgb name='sigmaS' value='0'/><rgb name='sigmaA' value='2'/></medium>",
       "parameter 'sigma_s' is -1, but must be at least 0: 0, 0, 0 is taken\n"},
      {"0.6.0", "<bsdf type='conductor'><float name='extEta' value='-1'/></bsdf>",
       "<bsdf type='conductor'><float name='extEta' value='1e-6'/></bsdf>", nullptr},
      {"0.6.0",
       "<bsdf type='mixturebsdf'><string name='weights' value='1, -3'/><bsdf type='diffuse'/><bsdf "
       "type='null'/></bsdf>",
       "<bsdf type='mixturebsdf'><string name='weights' value='1, 0'/><bsdf type='diffuse'/><bsdf "
       "type='null'/></bsdf>",
       "a weight in '1, -3' is negative: 0 is taken\n"},
      {"0.6.0",
       "<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'><float name='uscale' "
       "value='0'/></texture></bsdf>",
       "<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'><float name='uscale' "
       "value='1e-6'/></texture></bsdf>",
       "'uscale' must not be 0: 1e-06 is taken\n"},
      {"3.0.0", "<bsdf type='diffuse'><srgb name='reflectance' value='2 0.5 -1'/></bsdf>",
       "<bsdf type='diffuse'><srgb name='reflectance' value='1 0.5 0'/></bsdf>",
       "<srgb> values are between 0 and 1: 1 0.5 0 is taken for '2 0.5 -1'\n"},
      {"3.0.0",
       "<film type='hdrfilm'><rfilter type='box'><float name='radius' value='100'/></rfilter></film>",
       "<film type='hdrfilm'><rfilter type='box'><float name='radius' value='64'/></rfilter></film>",
       "parameter 'radius' is 100, but must be at most 64: 64 is taken\n"},
      {"3.0.0", "<sampler type='independent'><integer name='seed' value='-1'/></sampler>",
       "<sampler type='independent'><integer name='seed' value='0'/></sampler>",
       "parameter 'seed' is -1, but must be at least 0: 0 is taken\n"},
      {"3.0.0", "<integrator type='path'><integer name='rr_depth' value='0'/></integrator>",
       "<integrator type='path'><integer name='rr_depth' value='1'/></integrator>",
       "parameter 'rr_depth' is 0, but must be at least 1: 1 is taken\n"},
      {"3.0.0", "<shape type='sphere'><string name='radius' value='2'/></shape>",
       "<shape type='sphere'><float name='radius' value='2'/></shape>",
       "parameter 'radius' is a string, but must be <float>: 2 is taken\n"},
      {"3.0.0", "<bsdf type='dielectric'><string name='int_ior' value='jelly'/></bsdf>",
       "<bsdf type='dielectric'/>", nullptr},
      {"3.0.0", "<bsdf type='conductor'><string name='material' value='Unobtainium'/></bsdf>",
       "<bsdf type='conductor'/>", nullptr},
      {"0.6.0", "<bsdf type='phong'><boolean name='ensureEnergyConservation' value='false'/></bsdf>",
       "<bsdf type='phong'/>", nullptr},
      {"3.0.0",
       "<film type='hdrfilm'><integer name='width' value='9'/><integer name='crop_width' value='10'/></film>",
       "<film type='hdrfilm'><integer name='width' value='9'/></film>",
       "film 'hdrfilm': the crop window is not within the film: the whole film is rendered\n"},
      {"3.0.0",
       "<bsdf type='normalmap'><texture name='normalmap' type='checkerboard'/><bsdf type='bumpmap'>"
       "<texture type='checkerboard'/><bsdf type='conductor'/></bsdf></bsdf>",
       "<bsdf type='normalmap'><texture name='normalmap' type='checkerboard'/><bsdf "
       "type='conductor'/></bsdf>",
       nullptr},
      {"0.6.0",
       "<shape type='cube'><animation name='toWorld'><transform time='0'><translate x='1'/></transform>"
       "<transform time='1'><translate x='2'/></transform></animation></shape>",
       "<shape type='cube'><transform name='toWorld'><translate x='1'/></transform></shape>",
       "motion is not supported yet: it is passed over (the first transform of <animation> is taken)\n"},
  };
  for (const auto& test : cases) {
    EXPECT_FALSE(read_smallest(test.version, test.body, false).ok()) << test.body;
    EXPECT_TRUE(read_smallest(test.version, test.read_as, false).ok()) << test.read_as;
    EXPECT_EQ(scene_text(test.version, test.body, true), scene_text(test.version, test.read_as, false))
        << test.body;
    EXPECT_NE(notes_of(test.version, test.body), "") << test.body;
    if (test.told != nullptr) {
      EXPECT_EQ(notes_of(test.version, test.body), test.told);
    }
  }
  // An object of no type is of an unknown one.
  EXPECT_EQ(scene_text("3.0.0", "<shape type='cube'><bsdf/></shape>", true),
            scene_text("3.0.0", "<shape type='cube'><bsdf type='diffuse'/></shape>", false));
  EXPECT_NE(notes_of("3.0.0", "<shape type='cube'><bsdf/></shape>").find("it is read as 'diffuse'"),
            std::string::npos);
  EXPECT_FALSE(read_smallest("3.0.0", "<shape type='cube'><bsdf/></shape>", false).ok());
  EXPECT_FALSE(
      read_smallest("3.0.0", "<emitter type='spot'><float name='beam_width' value='30'/></emitter>", false)
          .ok());
  EXPECT_EQ(
      scene_text("3.0.0", "<emitter type='spot'><float name='beam_width' value='30'/></emitter>", true),
      scene_text("3.0.0", "<emitter type='spot'><float name='beam_width' value='20'/></emitter>", false));
  EXPECT_EQ(notes_of("3.0.0", "<emitter type='spot'><float name='beam_width' value='30'/></emitter>"),
            "parameter 'beam_width' is beyond cutoff_angle, 20: 20 is taken\n");
  // A required parameter that nothing can mend stays an error; a crop window within the film is none.
  EXPECT_FALSE(
      read_smallest("3.0.0", "<shape type='obj'><float name='filename' value='2'/></shape>", true).ok());
  EXPECT_EQ(notes_of("3.0.0", "<film type='hdrfilm'><integer name='crop_width' value='768'/></film>"), "");
  EXPECT_EQ(notes_of("3.0.0",
                     "<film type='hdrfilm'><integer name='crop_width' value='3'/>"
                     "<integer name='crop_offset_x' value='765'/></film>"),
            "");
  const auto beyond = read_smallest("3.0.0",
                                    "<film type='hdrfilm'><integer name='crop_width' value='3'/>"
                                    "<integer name='crop_offset_x' value='766'/></film>",
                                    false);
  ASSERT_FALSE(beyond.ok());
  EXPECT_NE(beyond.error().to_string().find(
                "the crop window, 3 x 576 pixels at 766, 0, is not within the film's 768 x 576"),
            std::string::npos)
      << beyond.error().to_string();
}

// Claim: a color of an old mask is told to count by its luminance.
TEST(DescriptionStock, ColoredOpacityCountsByLuminance) {
  const auto read = read_smallest(
      "0.6.0", "<bsdf type='mask'><rgb name='opacity' value='1, 0, 0'/><bsdf type='diffuse'/></bsdf>", false);
  ASSERT_TRUE(read.ok()) << read.error().to_string();
  ASSERT_EQ(read->description.notes.size(), 1u);
  EXPECT_NEAR(read->description.scene->children[0].object->get_number("opacity", 0), 0.212671, 1e-6);
}

}  // namespace
}  // namespace candela::description
