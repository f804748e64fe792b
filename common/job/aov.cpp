#include "common/job/aov.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>

#include "common/job/layer_name.h"

namespace candela {
namespace {

struct KindRow {
  AovKind kind;
  std::string_view name, letters;
};

constexpr std::array<KindRow, 16> kKinds = {{{AovKind::albedo, "albedo", "RGB"},
                                             {AovKind::depth, "depth", "Z"},
                                             {AovKind::position, "position", "XYZ"},
                                             {AovKind::uv, "uv", "UV"},
                                             {AovKind::geo_normal, "geo_normal", "XYZ"},
                                             {AovKind::sh_normal, "sh_normal", "XYZ"},
                                             {AovKind::dp_du, "dp_du", "XYZ"},
                                             {AovKind::dp_dv, "dp_dv", "XYZ"},
                                             {AovKind::prim_index, "prim_index", "I"},
                                             {AovKind::shape_index, "shape_index", "I"},
                                             {AovKind::coverage, "coverage", "Y"},
                                             {AovKind::duv_dx, "duv_dx", "UV"},
                                             {AovKind::duv_dy, "duv_dy", "UV"},
                                             {AovKind::boundary_test, "boundary_test", "Y"},
                                             {AovKind::crypto_object, "crypto_object", "RGB"},
                                             {AovKind::crypto_material, "crypto_material", "RGB"}}};
static_assert(kKinds.size() == static_cast<std::size_t>(kLastAovKind) + 1);

const KindRow& row_of(AovKind kind) {
  return kKinds[static_cast<std::size_t>(kind)];
}

std::optional<AovKind> kind_named(std::string_view name) {
  if (name == "normal") return AovKind::sh_normal;
  const auto found =
      std::find_if(kKinds.begin(), kKinds.end(), [&](const KindRow& row) { return row.name == name; });
  return found == kKinds.end() ? std::nullopt : std::optional(found->kind);
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

Result<Aov> parse_aov(std::string_view word) {
  const std::size_t colon = word.find(':');
  const std::string_view kind_text = trimmed(colon == std::string_view::npos ? word : word.substr(colon + 1));
  std::string_view name = trimmed(word.substr(0, colon));
  const std::optional<AovKind> kind = kind_named(kind_text);
  if (!kind)
    return usage_error(fmt::format("there is no AOV {}", printable_layer_name(kind_text)))
        .with_mend(fmt::format("there is {}, and normal for sh_normal", aov_kind_names()));
  // Names by which other programs know mattes.
  if (colon == std::string_view::npos && kind == AovKind::crypto_object) name = "CryptoObject";
  if (colon == std::string_view::npos && kind == AovKind::crypto_material) name = "CryptoMaterial";
  const Aov aov{std::string(name), *kind};
  std::string fault = fault_of_layer_name(aov.name);
  if (fault.empty()) fault = fault_of_layer_name(accumulator_name(aov));  // the longer name
  if (!fault.empty())
    return usage_error(fmt::format("an AOV cannot be called {}: {}", printable_layer_name(name), fault));
  return aov;
}

}  // namespace

std::string_view name(AovKind kind) {
  return row_of(kind).name;
}

std::string_view channel_letters(AovKind kind) {
  return row_of(kind).letters;
}

std::string aov_kind_names() {
  std::string names;
  for (const KindRow& row : kKinds) names += fmt::format("{}{}", names.empty() ? "" : ", ", row.name);
  return names;
}

std::vector<std::string> layer_names(const Aov& aov) {
  std::vector<std::string> names = {aov.name};
  for (std::size_t rank = 0; is_matte(aov.kind) && rank < kMatteRanks; rank += 2)
    names.push_back(fmt::format("{}{:02}", aov.name, rank / 2));
  return names;
}

std::string accumulator_name(const Aov& aov) {
  return std::string(kAovPrefix) + aov.name;
}

Result<std::vector<Aov>> parse_aovs(std::string_view text) {
  std::vector<Aov> aovs;
  std::set<std::string> layers;
  if (trimmed(text).empty() || trimmed(text) == "none") return aovs;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    CANDELA_ASSIGN(Aov aov, parse_aov(trimmed(text.substr(begin, end - begin))));
    for (const std::string& layer : layer_names(aov))
      if (!layers.insert(layer).second)
        return usage_error(fmt::format("two AOVs are called '{}'", layer))
            .with_mend("name them apart: NAME:KIND,NAME:KIND");
    if (aovs.size() == kMaxAovs) return usage_error(fmt::format("there are more than {} AOVs", kMaxAovs));
    aovs.push_back(std::move(aov));
    begin = end + 1;
  }
  return aovs;
}

std::string text_of(const std::vector<Aov>& aovs) {
  std::string text;
  for (const Aov& aov : aovs)
    text += fmt::format("{}{}:{}", text.empty() ? "" : ",", aov.name, name(aov.kind));
  return text;
}

}  // namespace candela
