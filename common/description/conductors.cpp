// Measured indices of refraction, as Mitsuba ships them and by its names.
//
// The measurements are those of the Luxpop database, which Mitsuba 0.6 and 3 carry as data/ior/*.spd: mostly
// [Palik 1998], and atomic scattering factors of CXRO and LLNL. Each was integrated with
// colorimetry::emitted(), which is what Mitsuba's RGB variants do with such a file, and negative components
// were set to 0. Some measurements end within the visible range (AlSb, Se, d-C) or have holes (AlAs); there
// they count as 0, as in Mitsuba.
#include "common/description/conductors.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "common/description/check.h"
#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

struct Material {
  std::string_view name;
  bool palik;  // the same under the name with "_palik" behind
  Vec3 eta, k;
};

constexpr std::array<Material, 41> kConductors = {{
    {"a-C", false, {2.944, 2.2271, 1.9682}, {0.88747, 0.7993, 0.81529}},
    {"Ag", false, {0.15528, 0.11673, 0.13839}, {4.8284, 3.1222, 2.1469}},
    {"Al", false, {1.6575, 0.88041, 0.52124}, {9.2238, 6.2695, 4.837}},
    {"AlAs", true, {3.6053, 3.233, 2.2161}, {0.00067934, 0, 0.0075122}},
    {"AlSb", true, {0, 4.1407, 4.6689}, {0, 0.094012, 1.3006}},
    {"Au", false, {0.14304, 0.37531, 1.442}, {3.983, 2.3856, 1.6034}},
    {"Be", true, {4.185, 3.185, 2.7841}, {3.8355, 3.0101, 2.869}},
    {"Cr", false, {4.3697, 2.9165, 1.6549}, {5.2066, 4.2313, 3.7547}},
    {"CsI", true, {2.1449, 1.7023, 1.6624}, {0, 0, 0}},
    {"Cu", false, {0.201, 0.92375, 1.1022}, {3.9133, 2.453, 2.1421}},
    {"Cu2O", true, {3.5518, 2.9499, 2.7519}, {0.11421, 0.1939, 0.60613}},
    {"Cu_palik", false, {0.21323, 0.91972, 1.1024}, {3.9219, 2.4573, 2.1366}},
    {"CuO", true, {3.2475, 2.4478, 2.2102}, {0.52109, 0.57003, 0.72218}},
    {"d-C", true, {2.7099, 2.3187, 2.2289}, {0, 0, 0}},
    {"Hg", true, {2.3989, 1.44, 0.90957}, {6.3276, 4.3719, 3.4218}},
    {"HgTe", true, {4.779, 3.2312, 2.6599}, {1.6316, 1.5808, 1.7293}},
    {"Ir", true, {3.0863, 2.0822, 1.6179}, {5.5922, 4.0671, 3.2673}},
    {"K", true, {0.064043, 0.04641, 0.038185}, {2.1042, 1.3489, 0.91312}},
    {"Li", true, {0.26579, 0.19562, 0.22095}, {3.5402, 2.3111, 1.6686}},
    {"MgO", true, {2.0896, 1.6507, 1.5949}, {0, 0, 0}},
    {"Mo", true, {4.484, 3.5251, 2.7763}, {4.1114, 3.4208, 3.1506}},
    {"Na_palik", false, {0.060269, 0.056141, 0.061988}, {3.1793, 2.1125, 1.579}},
    {"Nb", true, {3.4201, 2.7901, 2.3956}, {3.4414, 2.7377, 2.5797}},
    {"Ni_palik", false, {2.3673, 1.6634, 1.4671}, {4.4988, 3.0502, 2.3454}},
    {"Rh", true, {2.5858, 1.8602, 1.5543}, {6.7823, 4.703, 3.9761}},
    {"Se", true, {4.0586, 2.8429, 2.8208}, {0.75406, 0.63844, 0.52181}},
    {"Se-e", true, {5.7233, 4.1657, 4.0813}, {0.87114, 1.1052, 1.5653}},
    {"SiC", true, {3.1723, 2.526, 2.4794}, {7.5e-07, 0, 1e-05}},
    {"SnTe", true, {4.5243, 1.9817, 1.2816}, {0, 0, 0}},
    {"Ta", true, {2.0627, 2.3929, 2.6279}, {2.4084, 1.7415, 1.947}},
    {"Te", true, {7.3902, 4.4821, 2.6371}, {3.256, 3.5271, 3.292}},
    {"Te-e", true, {7.5089, 4.2964, 2.37}, {5.5839, 4.9472, 3.9976}},
    {"ThF4", true, {1.8307, 1.4422, 1.3876}, {0, 0, 0}},
    {"TiC", true, {3.7005, 2.8374, 2.5823}, {3.2656, 2.3516, 2.1728}},
    {"TiN", true, {1.6485, 1.1505, 1.3798}, {3.3683, 1.9435, 1.1021}},
    {"TiO2", true, {3.4566, 2.8017, 2.9052}, {0.0001052, 0, 0.00065248}},
    {"TiO2-e", true, {3.1066, 2.5132, 2.5824}, {3e-05, 0, 0.00018255}},
    {"V_palik", false, {4.2776, 3.513, 2.7611}, {3.4913, 2.8895, 3.1115}},
    {"VC", true, {3.6576, 2.7527, 2.5327}, {3.0683, 2.1987, 1.9632}},
    {"VN", true, {2.8656, 2.1192, 1.9401}, {3.0322, 2.0561, 1.6163}},
    {"W", false, {4.3708, 3.3002, 2.9984}, {3.5006, 2.6049, 2.2732}},
}};

}  // namespace

std::optional<ConductorIndex> named_conductor(std::string_view name) {
  for (const Material& material : kConductors) {
    if (name == material.name) return ConductorIndex{material.eta, material.k};
    if (material.palik && name.starts_with(material.name) && name.substr(material.name.size()) == "_palik")
      return ConductorIndex{material.eta, material.k};
  }
  return std::nullopt;
}

std::vector<std::string> conductor_names() {
  std::vector<std::string> names;
  for (const Material& material : kConductors) {
    names.emplace_back(material.name);
    if (material.palik) names.push_back(std::string(material.name) + "_palik");
  }
  return names;
}

Error unknown_conductor(const Property& material) {
  const std::string& name = std::get<std::string>(material.value);
  const std::vector<std::string> names = conductor_names();
  const std::vector<std::string_view> known(names.begin(), names.end());
  const std::string_view nearest = nearest_name(name, known);
  return input_error(fmt::format("{} is no material with measured indices of refraction", text::quote(name)))
      .at(material.where.file, material.where.line)
      .with_mend(nearest.empty() ? "give eta and k, or one of the names in docs/plugins.md"
                                 : text::did_you_mean(nearest));
}

void clamp_indices(Object& object, std::vector<Note>& notes) {
  if (object.category != "bsdf" || (object.plugin != "conductor" && object.plugin != "roughconductor"))
    return;
  for (Property& property : object.properties) {
    if (property.name != "eta" && property.name != "k") continue;
    auto* rgb = std::get_if<Rgb>(&property.value);
    if (rgb == nullptr || *std::min_element(rgb->value.begin(), rgb->value.end()) >= 0) continue;
    notes.push_back({property.where, fmt::format("negative components of '{}' become 0", property.name)});
    for (double& component : rgb->value) component = std::max(component, 0.0);
  }
}

Result<void> resolve_material(Object& object) {
  const auto found = std::find_if(object.properties.begin(), object.properties.end(),
                                  [](const Property& property) { return property.name == "material"; });
  if (found == object.properties.end()) return {};
  const Property material = std::move(*found);
  object.properties.erase(found);
  const std::string& name = std::get<std::string>(material.value);
  if (text::lower(name) == "none") return {};
  for (const std::string_view part : {"eta", "k"})
    if (object.find(part) != nullptr)
      return input_error(fmt::format("{} has both 'material' and '{}'", describe(object), part))
          .at(material.where.file, material.where.line)
          .with_mend("leave one of them out");
  const std::optional<ConductorIndex> index = named_conductor(name);
  if (!index) return unknown_conductor(material);
  object.properties.push_back({"eta", PropertyType::rgb, Rgb{index->eta}, material.where});
  object.properties.push_back({"k", PropertyType::rgb, Rgb{index->k}, material.where});
  return {};
}

}  // namespace candela::description
