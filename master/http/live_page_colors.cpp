// Finds the picture that a request means, and shows one number of its pixels in colors: the range of the
// numbers, and the colors of a map.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "common/base/text.h"
#include "common/image/false_color.h"
#include "common/job/layer_name.h"
#include "master/farm.h"
#include "master/http/live_page.h"
#include "master/http/page_json.h"

namespace candela::master {
namespace {

constexpr std::string_view kLayerTopic = "layer:";
constexpr int kColors = 256;

std::string query_text(const HttpRequest& request, const char* name) {
  const auto it = request.query.find(name);
  return it == request.query.end() ? std::string() : it->second;
}

// `N` numbers with commas between.
template <class T, std::size_t N>
std::optional<std::array<T, N>> numbers_of(std::string_view text) {
  std::array<T, N> out{};
  for (std::size_t i = 0; i < N; ++i) {
    const std::size_t end = i + 1 < N ? text.find(',') : text.size();
    if (end == std::string_view::npos) return std::nullopt;
    const auto [at, error] = std::from_chars(text.data(), text.data() + end, out[i]);
    if (error != std::errc() || at != text.data() + end) return std::nullopt;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

// One number of each pixel: a letter of the channels, the luminance of R, G and B, or the length of X, Y and
// Z, or U and V.
enum class Quantity : std::uint8_t { first, second, third, luminance, length };

Result<Quantity> quantity_of(const std::string& channel, const std::string& letters) {
  const bool colors = letters == "RGB", vectors = letters == "XYZ" || letters == "UV";
  if (channel.empty()) return colors ? Quantity::luminance : vectors ? Quantity::length : Quantity::first;
  if (channel == "luminance" && colors) return Quantity::luminance;
  if (channel == "length" && vectors) return Quantity::length;
  const std::size_t at = channel.size() == 1 ? letters.find(channel) : std::string::npos;
  if (at == std::string::npos)
    return usage_error("there is no channel " + quote(channel)).with_field("channel");
  return static_cast<Quantity>(at);
}

float pixel_number(const float* rgb, Quantity quantity) {
  if (quantity == Quantity::luminance)
    return static_cast<float>(0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]);
  if (quantity == Quantity::length)
    return static_cast<float>(std::hypot(double{rgb[0]}, double{rgb[1]}, double{rgb[2]}));
  return rgb[static_cast<std::size_t>(quantity)];
}

std::string hex_of(image::Color8 color) {
  return fmt::format("{:02x}{:02x}{:02x}", color[0], color[1], color[2]);
}

// All that a request for colors says, but for the picture.
struct ColorRequest {
  std::string channel;
  std::array<double, 2> percentiles = {1, 99};
  bool logarithmic = false;
  image::ColorMap map = image::ColorMap::viridis;
  std::optional<std::array<std::uint32_t, 4>> pixels = {};  // x0, y0, x1, y1: both corners are included
};

Result<ColorRequest> color_request_of(const HttpRequest& request) {
  ColorRequest out{.channel = query_text(request, "channel")};
  if (const std::string text = query_text(request, "percentiles"); !text.empty()) {
    const auto numbers = numbers_of<double, 2>(text);
    if (!numbers || !((*numbers)[0] >= 0 && (*numbers)[0] < (*numbers)[1] && (*numbers)[1] <= 100))
      return usage_error("percentiles are LOW,HIGH with 0 <= LOW < HIGH <= 100").with_field("percentiles");
    out.percentiles = *numbers;
  }
  if (const std::string text = query_text(request, "log"); !text.empty()) {
    if (text != "0" && text != "1") return usage_error("log is 0 or 1").with_field("log");
    out.logarithmic = text == "1";
  }
  if (const std::string text = query_text(request, "map"); !text.empty()) {
    const auto map = image::color_map_of(text);
    if (!map)
      return usage_error(fmt::format("a map is {}", fmt::join(image::kColorMapNames, ", ")))
          .with_field("map");
    out.map = *map;
  }
  if (const std::string text = query_text(request, "pixels"); !text.empty()) {
    out.pixels = numbers_of<std::uint32_t, 4>(text);
    if (!out.pixels || (*out.pixels)[0] > (*out.pixels)[2] || (*out.pixels)[1] > (*out.pixels)[3])
      return usage_error("pixels are X0,Y0,X1,Y1, the smaller ones first").with_field("pixels");
  }
  return out;
}

// Precondition: the pixels of the request are in the picture.
std::string colors_json(const Picture& picture, const ColorRequest& request, Quantity quantity) {
  const Picture::Level& level = picture.levels().front();
  const auto [x0, y0, x1, y1] =
      request.pixels.value_or(std::array<std::uint32_t, 4>{0, 0, level.width - 1, level.height - 1});
  std::vector<float> values;
  values.reserve(std::size_t{x1 - x0 + 1} * (y1 - y0 + 1));
  for (std::uint32_t y = y0; y <= y1; ++y)
    for (std::uint32_t x = x0; x <= x1; ++x)
      values.push_back(pixel_number(&level.rgb[3 * (std::size_t{y} * level.width + x)], quantity));
  // A black rectangle has no range on a logarithmic scale: no number of it has a color.
  const auto range = image::percentile_scale(values, request.percentiles[0], request.percentiles[1],
                                             request.logarithmic, false);
  const image::ColorScale scale = range.ok() ? *range : image::ColorScale{1, 2, request.logarithmic};
  const image::ValueSummary summary = image::summarize(values, scale);
  std::string colors;
  for (int i = 0; i < kColors; ++i)
    colors += hex_of(image::color_at(request.map, static_cast<double>(i) / (kColors - 1)));
  return JsonObject()
      .count("iterations", picture.iterations())
      .add("low", range.ok() ? scale.low : std::nan(""))
      .add("high", range.ok() ? scale.high : std::nan(""))
      .add("minimum", summary.minimum)
      .add("maximum", summary.maximum)
      .add("mean", summary.mean)
      .count("pixels", summary.pixels)
      .count("not_finite", summary.not_finite)
      .count("zero_or_less", summary.not_positive)
      .add("colors", colors)
      .add("not_finite_color", hex_of(image::kNotFiniteColor))
      .add("zero_or_less_color", hex_of(image::not_positive_color(request.map)))
      .text();
}

// The answer of all viewers with this request is made once.
Result<std::string> colors_of(Picture& picture, const ColorRequest& request) {
  const Picture::Level& level = picture.levels().front();
  if (level.rgb.empty()) return usage_error("a mix has no values of its own").with_field("kind");
  CANDELA_ASSIGN(const Quantity quantity, quantity_of(request.channel, picture.facts().letters));
  const auto [x0, y0, x1, y1] =
      request.pixels.value_or(std::array<std::uint32_t, 4>{0, 0, level.width - 1, level.height - 1});
  if (x1 >= level.width || y1 >= level.height)
    return usage_error("the pixels are outside of the picture").with_field("pixels");
  const std::string question =
      fmt::format("{} {} {} {} {} {},{},{},{}", static_cast<int>(quantity), request.percentiles[0],
                  request.percentiles[1], request.logarithmic, static_cast<int>(request.map), x0, y0, x1, y1);
  return picture.answer(question, [&] { return colors_json(picture, request, quantity); });
}

}  // namespace

Result<PictureKind> LivePage::kind_of(const HttpRequest& request) {
  const std::string kind = query_text(request, "kind");
  if (kind.empty() || kind == "image") return PictureKind{};
  if (kind == "error") return PictureKind{PictureKind::Kind::error};
  if (kind == "mix") return PictureKind{PictureKind::Kind::mix};
  if (kind != "layer")
    return usage_error("a picture is one of image, error, layer and mix").with_field("kind");
  PictureKind out{PictureKind::Kind::layer, query_text(request, "layer")};
  if (const std::string fault = fault_of_layer_name(out.layer); !fault.empty())
    return usage_error("no layer has this name: " + fault).with_field("layer");
  return out;
}

std::string LivePage::topic_of(const std::string& job_id, const PictureKind& kind) {
  switch (kind.kind) {
    case PictureKind::Kind::image:
      break;
    case PictureKind::Kind::error:
      return "error/" + job_id;
    case PictureKind::Kind::mix:
      return "mix/" + job_id;
    case PictureKind::Kind::layer:
      return fmt::format("{}{}/{}", kLayerTopic, kind.layer, job_id);
  }
  return "image/" + job_id;
}

PictureKind LivePage::kind_of_topic(const std::string& topic) {
  if (topic.starts_with("error/")) return {PictureKind::Kind::error};
  if (topic.starts_with("mix/")) return {PictureKind::Kind::mix};
  if (topic.starts_with(kLayerTopic))
    return {PictureKind::Kind::layer, topic.substr(kLayerTopic.size(), topic.find('/') - kLayerTopic.size())};
  return {};
}

std::shared_ptr<Picture> LivePage::shown_picture(const HttpRequest& request, const std::string& job_id,
                                                 HttpAnswer& otherwise) {
  const auto kind = kind_of(request);
  if (!kind.ok()) {
    otherwise = error_of(kind.error());
    return nullptr;
  }
  const Lock lock(mutex_);
  const auto it = topics_.find(topic_of(job_id, *kind));
  if (it != topics_.end() && it->second.picture_made) return it->second.picture_made;
  otherwise = error_answer(404, "there is no picture: open the job's stream first");
  return nullptr;
}

std::optional<HttpAnswer> LivePage::colors(const HttpRequest& request, const std::string& job_id,
                                           std::uint64_t connection) {
  auto asked = color_request_of(request);
  if (!asked.ok()) return error_of(asked.error());
  HttpAnswer otherwise;
  auto picture = shown_picture(request, job_id, otherwise);
  if (!picture) return otherwise;
  return later(connection, [picture = std::move(picture), asked = std::move(*asked)] {
    const auto text = colors_of(*picture, asked);
    return text.ok() ? HttpAnswer{.type = "application/json", .body = *text + "\n"} : error_of(text.error());
  });
}

}  // namespace candela::master
