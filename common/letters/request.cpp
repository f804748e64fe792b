#include "common/letters/request.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "common/base/nearest_name.h"
#include "common/base/text.h"
#include "common/film/layout.h"
#include "common/job/layer_name.h"
#include "common/letters/expression.h"
#include "common/letters/partition.h"

namespace candela::letters {
namespace {

// Layer 0 of a film is the image.
constexpr std::size_t kMaxExpressions = film::kMaxLayers - 1;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view spaces = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(spaces);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(spaces) + 1 - begin);
}

std::optional<double> number(std::string_view text) {
  text = trimmed(text);
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

// Before the '=' and behind it.
std::optional<std::pair<std::string_view, std::string_view>> assignment(std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos) return std::nullopt;
  return std::pair{trimmed(text.substr(0, equals)), trimmed(text.substr(equals + 1))};
}

// The front of `text` up to the next ';' that is in no { }; removes both.
std::string_view take_item(std::string_view& text) {
  std::size_t at = 0;
  for (bool in_name = false; at < text.size() && (in_name || text[at] != ';'); ++at) {
    if (in_name && text[at] == '\\')
      ++at;
    else if (text[at] == '{')
      in_name = true;
    else if (text[at] == '}')
      in_name = false;
  }
  at = std::min(at, text.size());
  const std::string_view item = text.substr(0, at);
  text.remove_prefix(std::min(at + 1, text.size()));
  return trimmed(item);
}

Result<NamedExpression> parse_layer(std::string_view text) {
  const auto parts = assignment(text);
  if (!parts)
    return input_error(fmt::format("{} is no layer", quote(text)))
        .with_mend("write NAME=EXPR: caustics=LS+DE");
  return NamedExpression{std::string(parts->first), std::string(parts->second)};
}

std::string_view first_word(std::string_view text) {
  return text.substr(0, text.find_first_of(" \t\r\n;"));
}

Result<void> add_item(std::string_view item, LayerRequest& request) {
  const std::string_view word = first_word(item), rest = trimmed(item.substr(word.size()));
  if (word == "layer") {
    CANDELA_ASSIGN(NamedExpression layer, parse_layer(rest));
    request.layers.push_back(std::move(layer));
  } else if (word == "region") {
    CANDELA_ASSIGN(Region region, parse_region(rest));
    request.regions.push_back(std::move(region));
  } else if (word == "glossy-below") {
    CANDELA_ASSIGN(request.glossy_below, parse_glossy_below(rest));
  } else if (word == "light-groups" && rest.empty()) {
    request.light_groups = true;
  } else if (word == "partition" && rest.empty()) {
    request.partition = true;
  } else {
    return input_error(fmt::format("{} asks for no layer", quote(item)))
        .with_mend(
            "write layer NAME=EXPR, region NAME=box:..., glossy-below NUMBER, light-groups or partition");
  }
  return {};
}

Result<void> add_items(std::string_view text, LayerRequest& request) {
  while (!text.empty()) {
    const std::string_view item = take_item(text);
    if (!item.empty()) CANDELA_TRY(add_item(item, request));
  }
  return {};
}

Result<void> check_region(const Region& region) {
  if (!is_region_name(region.name) || region.name.size() > kMaxLayerNameBytes)
    return input_error(fmt::format("a region cannot be called {}", quote(region.name)))
        .with_mend("use letters, digits, '_', '-' and '.', a letter first");
  const auto finite = [](double value) { return std::isfinite(value); };
  if (!std::all_of(region.low.begin(), region.low.end(), finite) ||
      !std::all_of(region.high.begin(), region.high.end(), finite) || !finite(region.radius))
    return input_error(fmt::format("region '{}' is not finite", region.name));
  if (region.kind == Region::Kind::sphere && !(region.radius > 0))
    return input_error(fmt::format("region '{}': the radius {} is not above 0", region.name, region.radius));
  for (std::size_t i = 0; i < 3 && region.kind == Region::Kind::box; ++i)
    if (region.low[i] > region.high[i])
      return input_error(fmt::format("region '{}': {} is above {}, the low corner comes first", region.name,
                                     region.low[i], region.high[i]));
  return {};
}

Result<void> check_regions(const LayerRequest& request) {
  if (request.regions.size() > kMaxRegions)
    return input_error(
        fmt::format("there are {} regions, more than {}", request.regions.size(), kMaxRegions));
  std::set<std::string_view> names;
  for (const Region& region : request.regions) {
    CANDELA_TRY(check_region(region));
    if (!names.insert(region.name).second)
      return input_error(fmt::format("two regions are called '{}'", region.name))
          .with_mend("name them apart");
  }
  return {};
}

Result<void> check_expression(const NamedExpression& layer, std::span<const std::string_view> regions) {
  const Result<Node> tree = parse_expression(layer.text);
  if (!tree) {
    Error error = tree.error();
    error.message = fmt::format("layer '{}', {}", layer.name, error.message);
    return error;
  }
  const Token* unknown = nullptr;
  for_each_token(*tree, [&](const Token& token) {
    if (unknown == nullptr && !token.region.empty() &&
        std::find(regions.begin(), regions.end(), token.region) == regions.end())
      unknown = &token;
  });
  if (unknown == nullptr) return {};
  Error error = input_error(fmt::format("layer '{}', column {}: there is no region {}", layer.name,
                                        unknown->column, quote(unknown->region)));
  for (const std::string_view region : regions)
    if (unknown->region.starts_with(region))
      return std::move(error).with_mend(fmt::format("a space ends the name: @{} ...", region));
  const std::string_view nearest = nearest_name(unknown->region, regions);
  return std::move(error).with_mend(
      nearest.empty() ? std::string("--region NAME=box:x0,y0,z0,x1,y1,z1 makes one") : did_you_mean(nearest));
}

// A name that fault_of_layer_name() has nothing against, as near to light.NAME as may be.
std::string layer_name_of(std::string_view lamp) {
  std::string name(kLightGroupPrefix);
  for (const char c : lamp) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       c == '-' || (c == '.' && name.back() != '.');
    name += plain ? c : '_';
  }
  constexpr std::size_t room_for_number = 4;
  name.resize(std::min(name.size(), kMaxLayerNameBytes - room_for_number));
  if (name.back() == '.') name += '_';
  return name;
}

}  // namespace

Result<void> add_layers(std::string_view text, LayerRequest& request) {
  constexpr std::array<std::string_view, 5> words = {"layer", "region", "glossy-below", "light-groups",
                                                     "partition"};
  const std::string_view word = first_word(trimmed(text));
  if (std::find(words.begin(), words.end(), word) != words.end()) return add_items(text, request);
  CANDELA_ASSIGN(NamedExpression layer, parse_layer(text));
  request.layers.push_back(std::move(layer));
  return {};
}

Result<Region> parse_region(std::string_view text) {
  const auto error = [&](std::string_view why) {
    return input_error(fmt::format("{} is no region: {}", quote(text), why))
        .with_mend("write NAME=box:x0,y0,z0,x1,y1,z1 or NAME=sphere:x,y,z,radius");
  };
  const auto parts = assignment(text);
  if (!parts) return error("it has no '='");
  Region region;
  region.name = parts->first;
  std::string_view rest = parts->second;
  const std::size_t colon = std::min(rest.find(':'), rest.size());
  const std::string_view kind = trimmed(rest.substr(0, colon));
  if (kind != "box" && kind != "sphere") return error("it is neither box: nor sphere:");
  region.kind = kind == "box" ? Region::Kind::box : Region::Kind::sphere;
  const std::size_t count = kind == "box" ? 6 : 4;
  std::array<double, 6> numbers{};
  std::size_t found = 0;
  for (std::size_t begin = colon + 1; begin <= rest.size(); ++found) {
    const std::size_t end = std::min(rest.find(',', begin), rest.size());
    const std::string_view word = rest.substr(begin, end - begin);
    const std::optional<double> value = number(word);
    if (!value) return error(fmt::format("{} is no finite number", quote(trimmed(word))));
    if (found < count) numbers[found] = *value;
    begin = end + 1;
  }
  if (found != count) return error(fmt::format("it has {} numbers, not {}", found, count));
  std::copy_n(numbers.begin(), 3, region.low.begin());
  if (region.kind == Region::Kind::box)
    std::copy_n(numbers.begin() + 3, 3, region.high.begin());
  else
    region.radius = numbers[3];
  CANDELA_TRY(check_region(region));
  return region;
}

Result<double> parse_glossy_below(std::string_view text) {
  const std::optional<double> value = number(text);
  if (!value || *value < 0)
    return input_error(fmt::format("{} is no roughness of at least 0", quote(text)))
        .with_mend(fmt::format("the default is {}", kDefaultGlossyBelow));
  return *value;
}

Result<LayerRequest> parse_layer_request(std::string_view text) {
  const auto check_size = [](std::size_t bytes) -> Result<void> {
    if (bytes <= kMaxRequestBytes) return {};
    return input_error(
        fmt::format("the layers have {} bytes of text, more than {}", bytes, kMaxRequestBytes));
  };
  CANDELA_TRY(check_size(text.size()));
  LayerRequest request;
  CANDELA_TRY(add_items(text, request));
  CANDELA_TRY(check(request));
  // The text is written again later, and the bound holds for the written form.
  CANDELA_TRY(check_size(text_of(request).size()));
  return request;
}

std::string text_of(const LayerRequest& request) {
  std::string text;
  const auto add = [&](std::string item) { text += (text.empty() ? "" : "; ") + std::move(item); };
  for (const NamedExpression& layer : request.layers) add(fmt::format("layer {}={}", layer.name, layer.text));
  for (const Region& region : request.regions) {
    const auto& [low, high] = std::pair(region.low, region.high);
    add(region.kind == Region::Kind::box ? fmt::format("region {}=box:{},{},{},{},{},{}", region.name, low[0],
                                                       low[1], low[2], high[0], high[1], high[2])
                                         : fmt::format("region {}=sphere:{},{},{},{}", region.name, low[0],
                                                       low[1], low[2], region.radius));
  }
  if (request.glossy_below != kDefaultGlossyBelow) add(fmt::format("glossy-below {}", request.glossy_below));
  if (request.light_groups) add("light-groups");
  if (request.partition) add("partition");
  return text;
}

Result<void> check(const LayerRequest& request) {
  if (request.empty() && request != LayerRequest{})
    return input_error("regions, glossy-below and partition belong to layers, and there is none")
        .with_mend("add --layer NAME=EXPR or --light-groups");
  if (!(request.glossy_below >= 0) || !std::isfinite(request.glossy_below))
    return input_error(
        fmt::format("glossy-below is {}, not a roughness of at least 0", request.glossy_below));
  if (request.layers.size() > kMaxExpressions)
    return input_error(fmt::format("there are {} layers of expressions, more than {}", request.layers.size(),
                                   kMaxExpressions))
        .with_mend("match several lamps or objects by one expression: L{key*}[DGSV]*E");
  CANDELA_TRY(check_regions(request));
  std::vector<std::string_view> regions;
  for (const Region& region : request.regions) regions.push_back(region.name);
  std::set<std::string_view> names;
  for (const NamedExpression& layer : request.layers) {
    if (const std::string fault = fault_of_layer_name(layer.name); !fault.empty())
      return input_error(
          fmt::format("a layer cannot be called {}: {}", printable_layer_name(layer.name), fault));
    if (!names.insert(layer.name).second)
      return input_error(fmt::format("two layers are called '{}'", layer.name)).with_mend("name them apart");
    CANDELA_TRY(check_expression(layer, regions));
  }
  return {};
}

LayerRequest expand_light_groups(LayerRequest request, std::span<const std::string> lamp_names) {
  if (!request.light_groups) return request;
  request.light_groups = false;
  std::set<std::string, std::less<>> taken;
  for (const NamedExpression& layer : request.layers) taken.insert(layer.name);
  std::set<std::string_view> seen;
  for (const std::string& lamp : lamp_names) {
    if (!seen.insert(lamp).second) continue;
    const std::string base = layer_name_of(lamp);
    std::string name = base;
    for (int number = 2; !taken.insert(name).second; ++number) name = fmt::format("{}_{}", base, number);
    request.layers.push_back({name, fmt::format("L{{{}}}[DGSV]*E", pattern_of(lamp))});
  }
  return request;
}

}  // namespace candela::letters
