// Names beside the table: what Mitsuba has and Candela does not yet, and named indices of refraction.
#include <algorithm>
#include <array>

#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

// ---- what Mitsuba has beside ----

struct MitsubaNames {
  std::string_view category;
  std::vector<std::string_view> names;
};

const std::vector<MitsubaNames>& mitsuba_names() {
  static const std::vector<MitsubaNames> names = {
      {"integrator",
       {"direct",
        "photonmapper",
        "vpl",
        "irrcache",
        "adaptive",
        "aov",
        "depth",
        "moment",
        "stokes",
        "prb",
        "prb_basic",
        "prbvolpath",
        "prb_projective",
        "direct_projective",
        "emission_reparam",
        "direct_reparam",
        "prb_reparam",
        "ao",
        "field",
        "multichannel",
        "upm",
        "singlescatter"}},
      {"sensor",
       {"telecentric", "spherical", "radiancemeter", "mradiancemeter", "fluencemeter", "batch",
        "perspective_rdist"}},
      {"film", {"specfilm", "tiledhdrfilm"}},
      {"shape", {"merge", "hair", "ellipsoids", "ellipsoidsmesh", "deformable"}},
      {"bsdf",
       {"mixturebsdf", "measured", "measured_polarized", "hair", "irawan", "polarizer", "retarder",
        "circular", "pplastic"}},
      {"emitter", {"collimated", "directionalarea", "timed_sunsky", "volumelight"}},
      {"texture", {"curvature"}},
      {"medium", {"specmedium"}},
      {"phase", {"mixturephase", "sggx", "tabphase", "kkay", "microflake", "forward"}},
      {"volume", {"volcache", "hgridvolume", "sggxvolume"}},
  };
  return names;
}

constexpr std::array<std::string_view, 1> later_categories = {"subsurface"};

// ---- indices of refraction ----

struct NamedIndex {
  std::string_view name;
  double value;
};

// Mitsuba's table (values of Hecht, Optics, 4th edition; at 589 nm, 0 to 20 degrees Celsius).
constexpr std::array<NamedIndex, 23> indices = {
    {{"vacuum", 1.0},      {"helium", 1.000036},        {"hydrogen", 1.000132},
     {"air", 1.000277},    {"carbon dioxide", 1.00045}, {"water", 1.3330},
     {"acetone", 1.36},    {"ethanol", 1.361},          {"carbon tetrachloride", 1.461},
     {"glycerol", 1.4729}, {"benzene", 1.501},          {"silicone oil", 1.52045},
     {"bromine", 1.661},   {"water ice", 1.31},         {"fused quartz", 1.458},
     {"pyrex", 1.470},     {"acrylic glass", 1.49},     {"polypropylene", 1.49},
     {"bk7", 1.5046},      {"sodium chloride", 1.544},  {"amber", 1.55},
     {"pet", 1.5750},      {"diamond", 2.419}}};

}  // namespace

Support support_of_category(std::string_view category) {
  const auto& later = later_categories;
  return std::find(later.begin(), later.end(), category) != later.end() ? Support::later : Support::none;
}

Support support_of_plugin(std::string_view category, std::string_view name) {
  for (const MitsubaNames& known : mitsuba_names())
    if (known.category == category &&
        std::find(known.names.begin(), known.names.end(), name) != known.names.end())
      return Support::later;
  return Support::none;
}

std::string_view canonical_plugin(std::string_view category, std::string_view name) {
  if (category == "film" && (name == "ldrfilm" || name == "mfilm")) return "hdrfilm";
  if (category != "integrator") return name;
  if (name == "volpath" || name == "volpathmis" || name == "volpath_simple") return "path";
  if (name == "ptracer") return "light";
  if (name == "sppm") return "ppm";
  return name;
}

std::optional<double> named_index_of_refraction(std::string_view name) {
  const std::string folded = text::lower(name);
  for (const NamedIndex& entry : indices)
    if (entry.name == folded) return entry.value;
  return std::nullopt;
}

std::vector<std::string_view> index_of_refraction_names() {
  std::vector<std::string_view> names;
  for (const NamedIndex& entry : indices) names.push_back(entry.name);
  return names;
}

}  // namespace candela::description
