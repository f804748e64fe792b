// Names beside the table: what Mitsuba has and Candela does not yet, named indices of refraction, and the
// nearest of several names.
#include <algorithm>
#include <array>
#include <limits>

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
        "mlt",
        "erpt",
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

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> last(b.size() + 1);
  std::vector<std::size_t> now(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    now[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      now[j] = std::min({last[j] + 1, now[j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        now[j] = std::min(now[j], before[j - 2] + 1);
    }
    std::swap(before, last);
    std::swap(last, now);
  }
  return last[b.size()];
}

std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known) {
  // Nobody mistypes a name this long; the bound keeps hostile input cheap.
  constexpr std::size_t max_length = 256;
  if (name.size() > max_length) return {};
  const std::string folded = text::lower(name);
  std::string_view nearest;
  std::size_t best = std::numeric_limits<std::size_t>::max();
  for (const std::string_view candidate : known) {
    if (candidate.size() > max_length) continue;
    // A difference in case alone counts for less than any edit.
    std::size_t distance = 2 * edit_distance(folded, text::lower(candidate));
    if (distance == 0 && candidate != name) distance = 1;
    if (distance < best) {
      best = distance;
      nearest = candidate;
    }
  }
  return best <= name.size() ? nearest : std::string_view();
}

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
