#include "common/image/mix.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <map>
#include <new>
#include <set>
#include <utility>

#include "common/base/files.h"
#include "common/base/nearest_name.h"
#include "common/base/strict_json.h"
#include "common/base/text.h"
#include "common/image/denoise.h"
#include "common/image/exr_channels.h"
#include "common/image/formats.h"
#include "common/image/image.h"
#include "common/job/layer_name.h"

namespace candela::image {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMaxNesting = 4;
constexpr std::string_view kLayersKey = "layers";
// Layers and the image are rounded to floats apart from each other.
constexpr double kRounding = 1e-5;

Error error_at(std::string key, std::string message) {
  return input_error(std::move(message)).with_field(std::move(key));
}

std::string below(std::string_view key, std::string_view name) {
  return fmt::format("{}.{}", key, escape_unprintable(std::string(clip_utf8(name, kMaxLayerNameBytes))));
}

std::string list_of(std::span<const std::string_view> names) {
  std::string out;
  for (const std::string_view name : names) out += (out.empty() ? "" : ", ") + std::string(name);
  return out;
}

Error unknown_key(std::string key, std::string_view name, std::span<const std::string_view> known) {
  const std::string_view nearest = nearest_name(name, known);
  return error_at(std::move(key), "this key is not known")
      .with_mend(nearest.empty() ? "there is " + list_of(known) : did_you_mean(nearest));
}

Result<double> factor_of(const Json& value, const std::string& key) {
  if (!value.is_number()) return error_at(key, "it is no number");
  const auto number = value.get<double>();
  if (!std::isfinite(number)) return error_at(key, "it is not finite");
  if (number < 0) return error_at(key, fmt::format("{} is below 0: a lamp takes no light away", number));
  if (number > kMaxMixFactor) return error_at(key, fmt::format("{} is beyond {}", number, kMaxMixFactor));
  return number;
}

Result<MixedLayer> read_layer_of_mix(const std::string& name, const Json& json, const std::string& key) {
  constexpr std::array<std::string_view, 2> known = {"intensity", "tint"};
  if (!json.is_object()) return error_at(key, "it is no object").with_mend(R"(write {"intensity": 2})");
  MixedLayer layer{.name = name};
  for (const auto& [word, value] : json.items()) {
    const std::string place = below(key, word);
    if (word == "intensity") {
      CANDELA_ASSIGN(layer.intensity, factor_of(value, place));
    } else if (word == "tint") {
      if (!value.is_array() || value.size() != layer.tint.size())
        return error_at(place, "it is no list of 3 numbers").with_mend("write [red, green, blue]");
      for (std::size_t c = 0; c < layer.tint.size(); ++c) {
        CANDELA_ASSIGN(layer.tint[c], factor_of(value[c], fmt::format("{}[{}]", place, c)));
      }
    } else {
      return unknown_key(place, word, known);
    }
  }
  return layer;
}

// The names in an attribute of several.
std::vector<std::string> names_of(std::string_view text) {
  std::vector<std::string> names;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(','), text.size());
    std::string_view name = text.substr(0, end);
    while (name.starts_with(' ')) name.remove_prefix(1);
    if (!name.empty()) names.emplace_back(name);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return names;
}

// A layer of an EXR with its factors.
struct Part {
  std::vector<std::size_t> channels;
  std::array<double, 3> factor = {1, 1, 1};
};

Error cannot_be_mixed(const MixedLayer& layer, const ExrChannels& all,
                      const std::vector<std::string>& partition) {
  const std::string key = below(kLayersKey, layer.name);
  std::vector<std::string_view> names(partition.begin(), partition.end());
  if (!channels_of_layer(all, layer.name, "RGB").empty())
    return error_at(key, "this layer is none of those that add up to the image")
        .with_mend("layers that can be mixed: " + list_of(names));
  const std::string_view nearest = nearest_name(layer.name, names);
  return error_at(key, "the image has no such layer")
      .with_mend(nearest.empty() ? "there is " + list_of(names) : did_you_mean(nearest));
}

Result<std::vector<Part>> parts_of(const ExrChannels& all, const std::map<std::string, std::string>& texts,
                                   const Mix& mix) {
  if (texts.contains(kMixAttribute))
    return input_error("the image is a mix already").with_mend("mix the image that it was made of");
  const auto named = texts.find(kPartitionAttribute);
  const std::vector<std::string> partition =
      named == texts.end() ? std::vector<std::string>() : names_of(named->second);
  if (partition.empty())
    return input_error("the image has no layers that add up to it, so that none can be mixed")
        .with_mend("render with --light-groups, or with --partition and layers by --layer");
  for (const MixedLayer& layer : mix.layers)
    if (std::find(partition.begin(), partition.end(), layer.name) == partition.end())
      return cannot_be_mixed(layer, all, partition);
  std::vector<Part> parts;
  for (const std::string& name : partition) {
    Part part{.channels = channels_of_layer(all, name, "RGB")};
    if (part.channels.empty())
      return input_error(fmt::format("the image lacks its layer {}, which belongs to its sum", quote(name)))
          .with_mend("mix the image as it was rendered");
    for (const MixedLayer& layer : mix.layers)
      if (layer.name == name)
        for (std::size_t c = 0; c < 3; ++c) part.factor[c] = layer.intensity * layer.tint[c];
    parts.push_back(std::move(part));
  }
  return parts;
}

bool belongs_to_unmixed(std::string_view channel) {
  for (const std::string_view layer : {kErrorLayer, kVarianceLayer, kDenoisedLayer})
    if (channel.size() == layer.size() + 2 && channel.starts_with(layer) && channel[layer.size()] == '.')
      return true;
  return false;
}

// The attributes of the image before the mix, which are not true of the mix.
std::map<std::string, std::string> mixed_texts(std::map<std::string, std::string> texts, const Mix& mix) {
  for (const char* const key : {"candela:relmse_estimate", "candela:relmse_upper", kPartitionAttribute})
    texts.erase(key);
  texts.erase(kDenoiserAttribute);
  texts.erase(kDenoisedErrorAttribute);
  texts[kMixAttribute] = text_of(mix);
  return texts;
}

Result<MixedExr> mix_channels(std::string_view exr, const Mix& mix) {
  CANDELA_ASSIGN(const ExrChannels all, read_channels(exr, "as a mix"));
  std::map<std::string, std::string> texts;
  for (const auto& [key, value] : all.spec.texts)
    if (!is_reserved_attribute(key)) texts[key] = value;
  CANDELA_ASSIGN(const std::vector<Part> parts, parts_of(all, texts, mix));
  const std::vector<std::size_t> image = channels_of_layer(all, "", "RGB");
  if (image.empty()) return input_error("the image has no channels R, G and B");
  {
    std::vector<std::vector<float>> values;
    for (const std::string& name : names_of(texts.at(kPartitionAttribute)))
      values.push_back(layer_values(all, name, "RGB"));
    const std::vector<std::span<const float>> layers(values.begin(), values.end());
    CANDELA_TRY(check_sum(static_cast<std::uint32_t>(all.spec.width), layer_values(all, "", "RGB"), layers));
  }
  // A mix of ones is the image, to the last bit.
  const bool unchanged = std::all_of(parts.begin(), parts.end(), [](const Part& part) {
    return part.factor == std::array<double, 3>{1, 1, 1};
  });
  MixedExr out;
  std::set<std::string> left_out;
  for (const std::string& channel : all.spec.channels)
    if (belongs_to_unmixed(channel)) left_out.insert(channel.substr(0, channel.size() - 2));
  out.left_out.assign(left_out.begin(), left_out.end());
  out.bytes = write_channels(
      all, mixed_texts(texts, mix),
      [](std::string_view channel) {
        return channel == "R" || channel == "G" || channel == "B" || belongs_to_unmixed(channel);
      },
      {"R", "G", "B"},
      [&](std::size_t /*pixel*/, const float* values, float* added) {
        for (std::size_t c = 0; c < 3; ++c) {
          double sum = 0;
          for (const Part& part : parts) sum += part.factor[c] * double{values[part.channels[c]]};
          added[c] = unchanged ? values[image[c]] : static_cast<float>(sum);
        }
      });
  return out;
}

}  // namespace

Result<Mix> parse_mix(std::string_view text) {
  constexpr std::array<std::string_view, 1> known = {kLayersKey};
  if (text.size() > kMaxMixBytes)
    return input_error(fmt::format("the mix has {} bytes of text, more than {}", text.size(), kMaxMixBytes));
  if (!is_utf8(text)) return input_error("the mix is no UTF-8");
  CANDELA_ASSIGN(const Json json, parse_strict_json(text, kMaxNesting));
  const char* const example = R"(write {"layers": {"light.key": {"intensity": 2}}})";
  if (!json.is_object()) return input_error("the mix is no object").with_mend(example);
  for (const auto& [word, value] : json.items())
    if (word != kLayersKey)
      return unknown_key(escape_unprintable(std::string(clip_utf8(word, kMaxLayerNameBytes))), word, known);
  if (!json.contains(kLayersKey))
    return error_at(std::string(kLayersKey), "it is missing").with_mend(example);
  const Json& layers = json.at(std::string(kLayersKey));
  if (!layers.is_object()) return error_at(std::string(kLayersKey), "it is no object").with_mend(example);
  Mix mix;
  for (const auto& [name, value] : layers.items()) {
    const std::string key = below(kLayersKey, name);
    if (const std::string fault = fault_of_layer_name(name); !fault.empty())
      return error_at(key, "no layer has this name: " + fault);
    CANDELA_ASSIGN(MixedLayer layer, read_layer_of_mix(name, value, key));
    mix.layers.push_back(std::move(layer));
  }
  return mix;
}

Result<Mix> read_mix(const std::filesystem::path& file) {
  CANDELA_ASSIGN(const std::string text, read_file(file, kMaxMixBytes));
  auto mix = parse_mix(text);
  if (mix.ok()) return mix;
  Error error = std::move(mix).error();
  return std::move(error).at(file.string(), 0);
}

std::string text_of(const Mix& mix) {
  Json json = Json::object();
  Json& layers = json[std::string(kLayersKey)] = Json::object();
  for (const MixedLayer& layer : mix.layers) {
    Json& one = layers[layer.name] = Json::object();
    one["intensity"] = layer.intensity;
    if (layer.tint != MixedLayer().tint) one["tint"] = layer.tint;
  }
  return json.dump();
}

Result<void> check_sum(std::uint32_t width, std::span<const float> image,
                       std::span<const std::span<const float>> layers) {
  double worst = 0;
  std::size_t where = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    double sum = 0, size = std::abs(double{image[i]});
    for (const std::span<const float> layer : layers) {
      sum += layer[i];
      size += std::abs(double{layer[i]});
    }
    const double share = !std::isfinite(size) ? std::numeric_limits<double>::infinity()
                         : size > 0           ? std::abs(sum - image[i]) / size
                                              : 0;
    if (share <= worst) continue;
    worst = share;
    where = i / 3;
  }
  if (worst <= kRounding) return {};
  return input_error(
             fmt::format("the layers do not add up to the image: at pixel ({}, {}) they differ from it "
                         "by {:.2g} of their sum",
                         where % width, where / width, worst))
      .with_mend("mix the image as it was rendered");
}

Result<MixedExr> mix_exr(std::string_view exr, const Mix& mix) {
  try {
    return mix_channels(exr, mix);
  } catch (const std::bad_alloc&) {
    return resource_error("the image to mix does not fit into memory");
  } catch (const std::exception& problem) {  // of the format library
    return input_error("cannot read or write the image: " + one_line(problem.what()));
  }
}

}  // namespace candela::image
