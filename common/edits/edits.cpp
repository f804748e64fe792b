#include "common/edits/edits.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "common/base/nearest_name.h"
#include "common/base/strict_json.h"
#include "common/base/text.h"
#include "common/job/layer_name.h"
#include "common/job/tools.h"
#include "common/letters/expression.h"

namespace candela::edits {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMaxNesting = 8;
constexpr double kMaxNumber = 1e12;  // coordinates and entries of matrices
constexpr std::string_view kNameARegion =
    R"(name it: "regions": {"NAME": {"box": [x0, y0, z0, x1, y1, z1]}})";

Error error_at(const std::string& key, std::string message) {
  return input_error(std::move(message)).with_field(key);
}

std::string below(const std::string& key, std::string_view name) {
  return key.empty() ? std::string(name) : fmt::format("{}.{}", key, name);
}

// An object of JSON at its key. Keys that nobody asked for are errors.
class Reader {
 public:
  Reader(const Json& json, std::string key) : json_(json), key_(std::move(key)) {}

  Result<void> check(std::span<const std::string_view> known) const {
    if (!json_.is_object()) return error_at(key_, "it is no object").with_mend("write { ... }");
    for (const auto& [name, value] : json_.items()) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      const std::string_view nearest = nearest_name(name, known);
      return error_at(below(key_, printable_key(name)), "this key is not known")
          .with_mend(nearest.empty() ? fmt::format("there is {}", fmt::join(known, ", "))
                                     : did_you_mean(nearest));
    }
    return {};
  }

  bool has(std::string_view name) const { return json_.contains(name); }
  const Json& at(std::string_view name) const { return json_.at(std::string(name)); }
  std::string key(std::string_view name) const { return below(key_, name); }

  Result<std::string> text(std::string_view name, const char* mend = "give a text") const {
    if (!has(name)) return error_at(key(name), "it is missing").with_mend(mend);
    if (!at(name).is_string()) return error_at(key(name), "it is no text");
    return at(name).get<std::string>();
  }

  Result<double> number(std::string_view name, double most = kMaxNumber) const {
    return number_of(at(name), key(name), most);
  }

  template <std::size_t N>
  Result<std::array<double, N>> numbers(std::string_view name, double most = kMaxNumber) const {
    if (!has(name)) return error_at(key(name), fmt::format("it is missing")).with_mend(count_mend<N>());
    const Json& value = at(name);
    if (!value.is_array() || value.size() != N)
      return error_at(key(name), value.is_array() ? fmt::format("it has {} entries, not {}", value.size(), N)
                                                  : "it is no list of numbers")
          .with_mend(count_mend<N>());
    std::array<double, N> out{};
    for (std::size_t i = 0; i < N; ++i) {
      CANDELA_ASSIGN(out[i], number_of(value[i], fmt::format("{}[{}]", key(name), i), most));
    }
    return out;
  }

 private:
  static std::string printable_key(const std::string& name) {
    return escape_unprintable(std::string(clip_utf8(name, 40)));
  }
  template <std::size_t N>
  static std::string count_mend() {
    return fmt::format("write a list of {} numbers", N);
  }
  static Result<double> number_of(const Json& value, const std::string& key, double most) {
    if (!value.is_number()) return error_at(key, "it is no number");
    const auto number = value.get<double>();
    if (!std::isfinite(number) || std::abs(number) > most)
      return error_at(key, fmt::format("{} is beyond {}", number, most));
    return number;
  }

  const Json& json_;
  std::string key_;
};

Result<letters::Region> read_region(const Json& json, const std::string& key, std::string name) {
  const Reader reader(json, key);
  constexpr std::array<std::string_view, 2> known = {"box", "sphere"};
  CANDELA_TRY(reader.check(known));
  letters::Region region;
  region.name = std::move(name);
  if (reader.has("box") == reader.has("sphere"))
    return error_at(key, "a region is a box or a sphere")
        .with_mend(R"(write {"box": [x0, y0, z0, x1, y1, z1]} or {"sphere": [x, y, z, radius]})");
  if (reader.has("box")) {
    CANDELA_ASSIGN(const auto n, reader.numbers<6>("box"));
    std::copy_n(n.begin(), 3, region.low.begin());
    std::copy_n(n.begin() + 3, 3, region.high.begin());
    for (std::size_t i = 0; i < 3; ++i)
      if (region.low[i] > region.high[i])
        return error_at(reader.key("box"), fmt::format("{} is above {}: the low corner comes first",
                                                       region.low[i], region.high[i]));
    const auto flat = [&](std::size_t i) { return region.low[i] == region.high[i]; };
    if (flat(0) + flat(1) + flat(2) > 1)
      return error_at(reader.key("box"), "the box is a line or a point, which nothing meets")
          .with_mend("let the corners differ in two coordinates at least");
    return region;
  }
  CANDELA_ASSIGN(const auto n, reader.numbers<4>("sphere"));
  region.kind = letters::Region::Kind::sphere;
  std::copy_n(n.begin(), 3, region.low.begin());
  region.radius = n[3];
  if (!(region.radius > 0)) return error_at(reader.key("sphere"), "the radius is not above 0");
  return region;
}

Triple middle_of(const letters::Region& region) {
  if (region.kind == letters::Region::Kind::sphere) return region.low;
  Triple middle{};
  for (std::size_t i = 0; i < 3; ++i) middle[i] = region.low[i] / 2 + region.high[i] / 2;
  return middle;
}

double determinant(const std::array<double, 9>& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

double length(const Triple& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

Result<Rotation> read_rotation(const Json& json, const std::string& key) {
  const Reader reader(json, key);
  constexpr std::array<std::string_view, 2> known = {"axis", "degrees"};
  CANDELA_TRY(reader.check(known));
  Rotation rotation;
  CANDELA_ASSIGN(rotation.axis, reader.numbers<3>("axis"));
  if (!(length(rotation.axis) > 1e-12)) return error_at(reader.key("axis"), "the axis has no length");
  if (!reader.has("degrees")) return error_at(reader.key("degrees"), "it is missing");
  CANDELA_ASSIGN(rotation.degrees, reader.number("degrees", 360));
  return rotation;
}

Result<Move> read_move(const Json& json, const std::string& key, const letters::Region* source) {
  const Reader reader(json, key);
  constexpr std::array<std::string_view, 5> known = {"to", "from", "linear", "stretch", "normal"};
  CANDELA_TRY(reader.check(known));
  Move move;
  if (!reader.has("from") && source == nullptr)
    return error_at(reader.key("from"), "it is missing")
        .with_mend("give the point that moves, or a source, whose middle it is then");
  if (reader.has("from")) {
    CANDELA_ASSIGN(move.from, reader.numbers<3>("from"));
  } else {
    move.from = middle_of(*source);
  }
  move.to = move.from;
  if (reader.has("to")) {
    CANDELA_ASSIGN(move.to, reader.numbers<3>("to"));
  }
  if (reader.has("linear") && reader.has("stretch"))
    return error_at(reader.key("stretch"), "linear and stretch exclude each other");
  if (reader.has("linear")) {
    CANDELA_ASSIGN(move.linear, reader.numbers<9>("linear", 1e6));
  }
  if (reader.has("stretch")) {
    CANDELA_ASSIGN(const Triple stretch, reader.numbers<3>("stretch", 1e6));
    move.linear = {stretch[0], 0, 0, 0, stretch[1], 0, 0, 0, stretch[2]};
  }
  // Relative to the sizes of the rows, so that a map may be small as a whole.
  const auto& m = move.linear;
  const double rows = length({m[0], m[1], m[2]}) * length({m[3], m[4], m[5]}) * length({m[6], m[7], m[8]});
  if (!(std::abs(determinant(m)) > 1e-9 * rows) || !(rows > 1e-18))
    return error_at(reader.key(reader.has("stretch") ? "stretch" : "linear"),
                    "the map is singular: it moves different directions to one")
        .with_mend("use three rows that lie in no plane, and no zeros in stretch");
  if (reader.has("normal")) {
    CANDELA_ASSIGN(move.normal, reader.numbers<3>("normal"));
    if (!(length(*move.normal) > 1e-12)) return error_at(reader.key("normal"), "the normal has no length");
  }
  return move;
}

Result<Edit> read_edit(const Json& json, const std::string& key, const EditList& list) {
  const Reader reader(json, key);
  constexpr std::array<std::string_view, 9> known = {"name",   "direction", "select", "source", "hit",
                                                     "rotate", "move",      "scale",  "tint"};
  CANDELA_TRY(reader.check(known));
  Edit edit;
  CANDELA_ASSIGN(edit.name, reader.text("name"));
  if (!letters::is_region_name(edit.name) || edit.name.size() > kMaxLayerNameBytes)
    return error_at(reader.key("name"), fmt::format("an edit cannot be called {}", quote(edit.name)))
        .with_mend("use letters, digits, '_', '-' and '.', a letter first");
  CANDELA_ASSIGN(const std::string direction, reader.text("direction", R"(write "light" or "eye")"));
  if (direction != "light" && direction != "eye")
    return error_at(reader.key("direction"), fmt::format("{} is no direction", quote(direction)))
        .with_mend("light turns what leaves the vertex, eye where it gathers from");
  edit.direction = direction == "light" ? Edit::Direction::light : Edit::Direction::eye;
  CANDELA_ASSIGN(edit.select, reader.text("select", "write a light path expression, such as LX*S{mirror}"));
  const auto tree = letters::parse_expression(edit.select);
  if (!tree.ok()) {
    Error error = tree.error();
    return std::move(error).with_field(reader.key("select"));
  }
  const letters::Token* unknown = nullptr;
  letters::for_each_token(*tree, [&](const letters::Token& token) {
    if (unknown == nullptr && !token.region.empty() && list.region(token.region) == nullptr) unknown = &token;
  });
  if (unknown != nullptr)
    return error_at(reader.key("select"),
                    fmt::format("column {}: there is no region {}", unknown->column, quote(unknown->region)))
        .with_mend(std::string(kNameARegion));
  const letters::Region* source = nullptr;
  if (reader.has("source")) {
    CANDELA_ASSIGN(edit.source, reader.text("source"));
    source = list.region(edit.source);
    if (source == nullptr)
      return error_at(reader.key("source"), fmt::format("there is no region {}", quote(edit.source)))
          .with_mend(std::string(kNameARegion));
  }
  if (reader.has("hit")) {
    if (!reader.at("hit").is_boolean()) return error_at(reader.key("hit"), "it is neither true nor false");
    edit.hit = reader.at("hit").get<bool>();
    if (edit.hit && source == nullptr)
      return error_at(reader.key("hit"), "there is no source that a direction could meet")
          .with_mend("give the region in which the first surface lies: \"source\": \"NAME\"");
  }
  if (reader.has("rotate") && reader.has("move"))
    return error_at(reader.key("move"), "rotate and move exclude each other").with_mend("make it two edits");
  if (reader.has("rotate")) {
    CANDELA_ASSIGN(edit.rotate, read_rotation(reader.at("rotate"), reader.key("rotate")));
  }
  if (reader.has("move")) {
    CANDELA_ASSIGN(edit.move, read_move(reader.at("move"), reader.key("move"), source));
  }
  const auto out_of_range = [&](std::string_view name, double factor) {
    return error_at(reader.key(name), fmt::format("a factor is {}, not within 0 and {}", factor, kMaxFactor));
  };
  if (reader.has("tint")) {
    CANDELA_ASSIGN(edit.factor, reader.numbers<3>("tint", kMaxFactor));
    for (const double factor : edit.factor)
      if (factor < 0) return out_of_range("tint", factor);
  }
  if (reader.has("scale")) {
    CANDELA_ASSIGN(const double scale, reader.number("scale", kMaxFactor));
    if (scale < 0) return out_of_range("scale", scale);
    for (double& factor : edit.factor) {
      factor *= scale;
      if (factor > kMaxFactor) return out_of_range(reader.has("tint") ? "tint" : "scale", factor);
    }
  }
  return edit;
}

// Compares parameters, not maps that are computed: only then are the pixels' bits the same.
bool changes_nothing(const Edit& edit) {
  const bool stays = !edit.move || (edit.move->from == edit.move->to && edit.move->linear == Move().linear);
  return edit.factor == Triple{1, 1, 1} && stays && (!edit.rotate || edit.rotate->degrees == 0);
}

Result<EditList> read_list(const Json& json) {
  const Reader reader(json, "");
  constexpr std::array<std::string_view, 3> known = {"edits", "regions", "glossy_below"};
  CANDELA_TRY(reader.check(known));
  EditList list;
  if (reader.has("regions")) {
    if (!reader.at("regions").is_object())
      return error_at("regions", "it is no object").with_mend(R"(write {"NAME": {"sphere": [x, y, z, r]}})");
    for (const auto& [name, value] : reader.at("regions").items()) {
      const std::string key = below("regions", escape_unprintable(std::string(clip_utf8(name, 40))));
      if (!letters::is_region_name(name) || name.size() > kMaxLayerNameBytes)
        return error_at(key, "a region cannot be called that")
            .with_mend("use letters, digits, '_', '-' and '.', a letter first");
      if (list.regions.size() == letters::kMaxRegions)
        return error_at(key, fmt::format("there are more than {} regions", letters::kMaxRegions));
      CANDELA_ASSIGN(letters::Region region, read_region(value, key, name));
      list.regions.push_back(std::move(region));
    }
  }
  if (reader.has("glossy_below")) {
    CANDELA_ASSIGN(list.glossy_below, reader.number("glossy_below", 1e6));
    if (list.glossy_below < 0) return error_at("glossy_below", "it is below 0");
  }
  if (!reader.has("edits") || !reader.at("edits").is_array())
    return error_at("edits", "it is missing, or no list").with_mend(R"(write {"edits": [ {...} ]})");
  std::set<std::string> names;
  for (const Json& entry : reader.at("edits")) {
    const std::string key = fmt::format("edits[{}]", names.size());
    if (names.size() == kMaxEdits) return error_at(key, fmt::format("there are more than {}", kMaxEdits));
    CANDELA_ASSIGN(Edit edit, read_edit(entry, key, list));
    if (!names.insert(edit.name).second)
      return error_at(key + ".name", fmt::format("two edits are called '{}'", edit.name))
          .with_mend("name them apart");
    if (!changes_nothing(edit)) list.edits.push_back(std::move(edit));
  }
  if (list.empty()) return EditList{};
  return list;
}

Json json_of(const letters::Region& region) {
  const auto& [low, high] = std::pair(region.low, region.high);
  if (region.kind == letters::Region::Kind::box)
    return {{"box", {low[0], low[1], low[2], high[0], high[1], high[2]}}};
  return {{"sphere", {low[0], low[1], low[2], region.radius}}};
}

Json json_of(const Edit& edit) {
  Json json = {{"name", edit.name},
               {"direction", edit.direction == Edit::Direction::light ? "light" : "eye"},
               {"select", edit.select}};
  if (!edit.source.empty()) json["source"] = edit.source;
  if (edit.hit) json["hit"] = true;
  if (edit.rotate) json["rotate"] = {{"axis", edit.rotate->axis}, {"degrees", edit.rotate->degrees}};
  if (edit.move) {
    Json& move = json["move"] = {{"to", edit.move->to}, {"from", edit.move->from}};
    if (edit.move->linear != Move().linear) move["linear"] = edit.move->linear;
    if (edit.move->normal) move["normal"] = *edit.move->normal;
  }
  if (edit.factor != Triple{1, 1, 1}) json["tint"] = edit.factor;
  return json;
}

}  // namespace

const letters::Region* EditList::region(std::string_view name) const {
  const auto found =
      std::find_if(regions.begin(), regions.end(), [&](const letters::Region& r) { return r.name == name; });
  return found == regions.end() ? nullptr : &*found;
}

Result<EditList> parse_edits(std::string_view text) {
  if (text.empty()) return EditList{};
  if (text.size() > kMaxEditsBytes)
    return input_error(
        fmt::format("the edits have {} bytes of text, more than {}", text.size(), kMaxEditsBytes));
  if (!is_utf8(text)) return input_error("the edits are no UTF-8");
  CANDELA_ASSIGN(const Json json, parse_strict_json(text, kMaxNesting));
  CANDELA_ASSIGN(EditList list, read_list(json));
  if (text_of(list).size() > kMaxEditsBytes)
    return input_error(fmt::format("the edits have more than {} bytes of text", kMaxEditsBytes));
  return list;
}

std::string text_of(const EditList& list) {
  if (list.empty()) return {};
  Json json = Json::object();
  for (const letters::Region& region : list.regions) json["regions"][region.name] = json_of(region);
  if (list.glossy_below != letters::kDefaultGlossyBelow) json["glossy_below"] = list.glossy_below;
  for (const Edit& edit : list.edits) json["edits"].push_back(json_of(edit));
  return json.dump();
}

int max_depth_of(const SettingsMap& integrator_settings) {
  const auto found = integrator_settings.find("max_depth");
  int depth = -1;
  if (found == integrator_settings.end()) return depth;
  const std::string& text = found->second;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), depth);
  return code == std::errc() ? depth : -1;
}

Result<void> check_integrator(const EditList& list, std::string_view integrator, int max_depth) {
  if (list.empty()) return {};
  constexpr std::array<std::string_view, 8> able = {"path", "light", "bdpt",   "ppm",
                                                    "bpm",  "vcm",   "pssmlt", "mmlt"};
  if (std::find(able.begin(), able.end(), tools::paths_of(integrator)) == able.end())
    return usage_error(fmt::format("the integrator '{}' does not render edits: '{}' and the others are not "
                                   "tested with it",
                                   integrator, list.edits.front().name))
        .with_field("edits")
        .with_mend(fmt::format("use one of {}", fmt::join(able, ", ")));
  if (max_depth >= 0) return {};
  const Edit* light = nullptr;
  const Edit* eye = nullptr;
  for (const Edit& edit : list.edits) {
    (edit.direction == Edit::Direction::light ? light : eye) = &edit;
    for (const double factor : edit.factor)
      if (factor > 1)
        return usage_error(fmt::format("the edit '{}' makes light brighter, and paths have no longest: light "
                                       "may grow without end",
                                       edit.name))
            .with_field("edits")
            .with_mend("give --set max_depth=N, or a scale and a tint up to 1");
  }
  if (light != nullptr && eye != nullptr)
    return usage_error(fmt::format("the edit '{}' turns light and '{}' what is gathered, and paths have no "
                                   "longest: light may grow without end",
                                   light->name, eye->name))
        .with_field("edits")
        .with_mend("give --set max_depth=N");
  return {};
}

}  // namespace candela::edits
