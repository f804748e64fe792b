#include "client/check_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "client/values.h"
#include "common/wire/json_values.h"

namespace candela::client {
namespace {

using description::Finding;
using wire::Json;

std::string plural(std::uint64_t number, std::string_view one, std::string_view many) {
  return fmt::format("{} {}", number, number == 1 ? one : many);
}

std::string bytes_text(std::uint64_t bytes) {
  constexpr std::array<std::string_view, 5> units = {"B", "KiB", "MiB", "GiB", "TiB"};
  if (bytes < 1024) return fmt::format("{} B", bytes);
  double value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (value >= 1024 && unit + 1 < units.size()) {
    value /= 1024;
    ++unit;
  }
  return fmt::format("{:.1f} {}", value, units[unit]);
}

std::string plugins_text(const std::map<std::string, std::uint64_t>& plugins) {
  std::string text;
  for (const auto& [plugin, number] : plugins) {
    text += fmt::format("{}{}", text.empty() ? "" : ", ", plugin);
    if (number > 1) text += fmt::format(" x{}", number);
  }
  return text;
}

// In the order people think of them; others follow by name.
constexpr std::array<std::string_view, 12> order = {"shape",  "bsdf",    "texture", "emitter",
                                                    "medium", "phase",   "volume",  "sensor",
                                                    "film",   "rfilter", "sampler", "integrator"};

std::vector<std::string> ordered_categories(const description::Review& review) {
  std::vector<std::string> names;
  for (const std::string_view category : order)
    if (review.uses.contains(std::string(category))) names.emplace_back(category);
  for (const auto& [category, plugins] : review.uses)
    if (std::find(names.begin(), names.end(), category) == names.end()) names.push_back(category);
  return names;
}

}  // namespace

std::uint64_t CheckReport::warning_count() const {
  return static_cast<std::uint64_t>(
      std::count_if(review.findings.begin(), review.findings.end(),
                    [](const Finding& finding) { return is_warning(finding.kind); }));
}

std::string CheckReport::to_text() const {
  std::uint64_t all_bytes = 0;
  for (const File& file : files) all_bytes += file.bytes;
  std::string text = fmt::format("scene: {} ({}, {})\n", printable(scene),
                                 plural(files.size(), "file", "files"), bytes_text(all_bytes));
  for (const std::string& category : ordered_categories(review)) {
    text += fmt::format("{}: {}", category, plugins_text(review.uses.at(category)));
    if (category == "shape") text += fmt::format("; {}", plural(triangles, "triangle", "triangles"));
    if (category == "film") text += fmt::format("; {} x {} pixels", width, height);
    text += '\n';
  }
  text += fmt::format("runs: {}", printable(integrator));
  for (const auto& [key, value] : integrator_settings)
    text += fmt::format(", {} = {}", printable(key), printable(value));
  text += fmt::format(", filter {}\n", filter);
  for (const Image& image : images)
    text +=
        fmt::format("image: {}: {} x {}, {}, {} bits, {}\n", printable(image.path), image.width, image.height,
                    plural(image.channels, "channel", "channels"), image.bits, bytes_text(image.file_bytes));
  for (const File& file : files)
    text += fmt::format("file: {}: {}\n", printable(file.path), bytes_text(file.bytes));
  for (const Finding& finding : review.findings) {
    text += fmt::format("{}: {}:{}: {}", is_warning(finding.kind) ? "warning" : "note",
                        printable(finding.where.file), finding.where.line, printable(finding.text));
    if (finding.count > 1) text += fmt::format(" (and {} more like it)", finding.count - 1);
    text += '\n';
  }
  text += fmt::format("{}, {}\n", plural(warning_count(), "warning", "warnings"),
                      plural(review.findings.size() - warning_count(), "note", "notes"));
  return text;
}

std::string CheckReport::to_json() const {
  Json json;
  json["scene"] = scene;
  Json uses = Json::object();
  for (const std::string& category : ordered_categories(review)) {
    Json plugins = Json::object();
    for (const auto& [plugin, number] : review.uses.at(category)) plugins[plugin] = number;
    uses[category] = plugins;
  }
  json["uses"] = uses;
  json["triangles"] = triangles;
  json["dropped_faces"] = dropped_faces;
  json["width"] = width;
  json["height"] = height;
  json["filter"] = filter;
  json["integrator"] = integrator;
  Json settings = Json::object();
  for (const auto& [key, value] : integrator_settings) settings[key] = value;
  json["integrator_settings"] = settings;
  json["images"] = Json::array();
  for (const Image& image : images)
    json["images"].push_back({{"path", image.path},
                              {"width", image.width},
                              {"height", image.height},
                              {"channels", image.channels},
                              {"bits", image.bits},
                              {"bytes", image.file_bytes}});
  json["files"] = Json::array();
  for (const File& file : files) json["files"].push_back({{"path", file.path}, {"bytes", file.bytes}});
  json["warnings"] = warning_count();
  json["findings"] = Json::array();
  for (const Finding& finding : review.findings)
    json["findings"].push_back({{"kind", std::string(name(finding.kind))},
                                {"file", finding.where.file},
                                {"line", finding.where.line},
                                {"count", finding.count},
                                {"text", finding.text}});
  return wire::json_text(json);
}

}  // namespace candela::client
