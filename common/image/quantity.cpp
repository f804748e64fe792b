#include "common/image/quantity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <numbers>
#include <string_view>
#include <utility>

#include "common/base/nearest_name.h"
#include "common/base/text.h"
#include "common/image/byte_source.h"
#include "common/image/formats.h"
#include "common/image/image.h"
#include "common/job/layer_name.h"

namespace candela::image {
namespace {

// A layer with the letters of its channels: "RGB", "XYZ", "UV", or one letter.
struct LayerEntry {
  std::string name, letters;
};

Result<void> check_exr(const std::filesystem::path& path) {
  CANDELA_ASSIGN(const auto source, file_source(path));
  std::array<char, 16> magic{};
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(magic.size(), source->size()));
  const char* const format =
      source->read(0, count, magic.data()) ? format_of({magic.data(), count}, path.string()) : nullptr;
  if (format != nullptr && std::string_view(format) == "openexr") return {};
  if (format == nullptr) return input_error("this is no EXR file").at(path.string(), 0);
  return input_error("this is a file of the format '" + std::string(format) +
                     "', whose values are no radiance")
      .at(path.string(), 0)
      .with_mend("give the EXR of the image");
}

// The layers that read_layer() knows, in the file's order.
Result<std::vector<LayerEntry>> layers_of(const std::filesystem::path& path) {
  std::vector<LayerEntry> layers;
  const auto has = [](const ImageSpec& spec, const std::string& channel) {
    return std::find(spec.channels.begin(), spec.channels.end(), channel) != spec.channels.end();
  };
  CANDELA_ASSIGN(const auto reader, open_file(path));
  try {
    for (int part = 0; reader->seek_part(part); ++part) {
      const ImageSpec& spec = reader->spec();
      for (const std::string& channel : spec.channels) {
        if (channel.size() < 3 || channel[channel.size() - 2] != '.') continue;
        const std::string name = channel.substr(0, channel.size() - 2);
        if (std::any_of(layers.begin(), layers.end(), [&](const LayerEntry& l) { return l.name == name; }))
          continue;
        for (const std::string_view letters : {"RGB", "XYZ", "UV", "Z", "Y", "I"})
          if (std::all_of(letters.begin(), letters.end(),
                          [&](char letter) { return has(spec, name + '.' + letter); })) {
            layers.push_back({name, std::string(letters)});
            break;
          }
      }
    }
  } catch (const std::exception& problem) {  // of the format library
    return input_error("cannot read the image: " + one_line(problem.what())).at(path.string(), 0);
  }
  return layers;
}

Error no_such_layer(const std::filesystem::path& path, const std::string& layer,
                    const std::vector<LayerEntry>& layers) {
  constexpr std::size_t kMaxNamed = 5;
  std::vector<std::pair<std::size_t, std::string>> nearest;
  for (const LayerEntry& entry : layers) nearest.emplace_back(edit_distance(layer, entry.name), entry.name);
  std::stable_sort(nearest.begin(), nearest.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  const bool more = nearest.size() > kMaxNamed;
  if (more) nearest.resize(kMaxNamed);
  std::string list;
  for (const auto& [distance, name] : nearest) list += (list.empty() ? "" : ", ") + name;
  if (layers.empty())
    list = "it has none at all";
  else
    list =
        more ? "of " + std::to_string(layers.size()) + " layers the nearest are " + list : "there is " + list;
  return input_error("the image has no layer '" + layer + "'")
      .at(path.string(), 0)
      .with_mend(std::move(list));
}

// "R, G, B, luminance"
std::string channels_of(const std::string& letters) {
  std::string list;
  for (const char letter : letters) list += (list.empty() ? "" : ", ") + std::string(1, letter);
  if (letters == "RGB") list += ", luminance";
  if (letters == "XYZ" || letters == "UV") list += ", length";
  return list;
}

enum class Making : std::uint8_t { as_stored, square, root, irradiance };
constexpr std::string_view kIrradiance = "irradiance", kAlbedo = "albedo";

// The number of a pixel: `at`, which of the three values; -1 for luminance, -2 for length.
constexpr int kLuminance = -1, kLength = -2;
double number_of(const float* v, int at) {
  if (at >= 0) return v[at];
  if (at == kLength) return std::hypot(double{v[0]}, double{v[1]}, double{v[2]});
  return 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2];
}

}  // namespace

Result<Quantity> read_quantity(const std::filesystem::path& path, const std::string& layer,
                               const std::string& channel) {
  CANDELA_TRY(check_exr(path));
  std::string letters = "RGB", stored = layer;
  Making making = Making::as_stored;
  if (!layer.empty()) {
    CANDELA_ASSIGN(const std::vector<LayerEntry> layers, layers_of(path));
    const auto find = [&](std::string_view name) {
      return std::find_if(layers.begin(), layers.end(), [&](const LayerEntry& l) { return l.name == name; });
    };
    auto found = find(layer);
    if (found == layers.end() && (layer == kErrorLayer || layer == kVarianceLayer)) {
      making = layer == kErrorLayer ? Making::root : Making::square;
      found = find(layer == kErrorLayer ? kVarianceLayer : kErrorLayer);
    }
    if (found == layers.end() && layer == kIrradiance) {
      making = Making::irradiance;
      found = find(kAlbedo);
      if (found == layers.end() || found->letters != "RGB")
        return input_error("the irradiance is made of the layer 'albedo', which the image does not have")
            .at(path.string(), 0)
            .with_mend("render with --aov albedo");
    }
    if (found == layers.end()) return no_such_layer(path, layer, layers);
    letters = found->letters;
    stored = found->name;
  }
  int at = letters.size() == 1 ? 0 : letters == "RGB" ? kLuminance : kLength;
  if (!channel.empty()) {
    if (channel.size() == 1 && letters.find(channel) != std::string::npos)
      at = static_cast<int>(letters.find(channel));
    else if (!(channel == "luminance" && letters == "RGB") &&
             !(channel == "length" && (letters == "XYZ" || letters == "UV")))
      return usage_error("there is no '" + escape_unprintable(channel) + "' of " +
                         (layer.empty() ? "the image" : "the layer '" + escape_unprintable(layer) + "'"))
          .with_field("--channel")
          .with_mend("there is " + channels_of(letters));
  }
  CANDELA_ASSIGN(const Image image, layer.empty() ? read_image(path) : read_layer(path, stored));
  std::vector<float> radiance;
  if (making == Making::irradiance) {
    CANDELA_ASSIGN(Image whole, read_image(path));
    if (whole.rgb.size() != image.rgb.size())
      return input_error("the layer 'albedo' has another size than the image").at(path.string(), 0);
    radiance = std::move(whole.rgb);
  }
  Quantity quantity{image.width, image.height, std::vector<float>(image.rgb.size() / 3), layer};
  // The luminance of a variance is that of the standard deviations, squared.
  const bool deviations = at == kLuminance && stored == kVarianceLayer;
  const auto square = [](double v) { return v * v; };
  for (std::size_t i = 0; i < quantity.values.size(); ++i) {
    std::array<float, 3> v = {image.rgb[3 * i], image.rgb[3 * i + 1], image.rgb[3 * i + 2]};
    if (deviations)
      for (float& value : v) value = std::sqrt(value);
    if (making == Making::irradiance)  // not finite where nothing is reflected
      for (std::size_t c = 0; c < 3; ++c) v[c] = std::numbers::pi_v<float> * radiance[3 * i + c] / v[c];
    double number = number_of(v.data(), at);
    if (making == Making::square || (deviations && making == Making::as_stored)) number = square(number);
    if (making == Making::root && !deviations) number = std::sqrt(number);
    quantity.values[i] = static_cast<float>(number);
  }
  if (letters.size() > 1 || layer.empty()) {
    const std::string part = at == kLuminance ? "luminance"
                             : at == kLength  ? "length"
                                              : std::string(1, letters[static_cast<std::size_t>(at)]);
    quantity.name = layer.empty() ? (at == kLuminance ? part : "radiance, " + part) : layer + ", " + part;
  }
  return quantity;
}

}  // namespace candela::image
