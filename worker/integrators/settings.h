// Settings of integrators: one struct each, whose fields() names every field once; parsing, printing,
// validation and docs all walk that list.
#pragma once

#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "worker/render/renderer.h"

namespace candela::integrators {

// A field that is one of a closed set of names.
struct Choice {
  std::string value;
  std::vector<std::string_view> names;
};

// Visitor that reads fields from text and remembers what it consumed.
class SettingsReader {
 public:
  explicit SettingsReader(const SettingsMap& map) : map_(map) {}

  void operator()(std::string_view name, int& field, int lowest, int highest, std::string_view doc) {
    (void)doc;
    if (const std::string* text = take(name)) {
      int value = 0;
      const auto [end, code] = std::from_chars(text->data(), text->data() + text->size(), value);
      if (code != std::errc() || end != text->data() + text->size() || value < lowest || value > highest)
        fail(name, fmt::format("'{}' is not an integer from {} to {}", *text, lowest, highest));
      else
        field = value;
    }
  }
  void operator()(std::string_view name, bool& field, std::string_view doc) {
    (void)doc;
    if (const std::string* text = take(name)) {
      if (*text == "true")
        field = true;
      else if (*text == "false")
        field = false;
      else
        fail(name, fmt::format("'{}' is neither true nor false", *text));
    }
  }
  void operator()(std::string_view name, Choice& field, std::string_view doc) {
    (void)doc;
    if (const std::string* text = take(name)) {
      for (std::string_view known : field.names)
        if (*text == known) {
          field.value = *text;
          return;
        }
      fail(name, fmt::format("'{}' is not one of {}", *text, fmt::join(field.names, ", ")));
    }
  }
  // After all fields: an error for a bad value, or for a key that no field took.
  Result<void> finish() const;

 private:
  const std::string* take(std::string_view name) {
    known_.emplace_back(name);
    const auto found = map_.find(std::string(name));
    return found == map_.end() ? nullptr : &found->second;
  }
  void fail(std::string_view name, std::string message) {
    if (ok_) error_ = usage_error(std::move(message)).with_field(std::string(name));
    ok_ = false;
  }
  const SettingsMap& map_;
  std::vector<std::string> known_;
  bool ok_ = true;
  Error error_;
};

// Visitor that writes fields out as text, and as documentation.
class SettingsWriter {
 public:
  void operator()(std::string_view name, int& field, int lowest, int highest, std::string_view doc) {
    add(name, fmt::format("integer {}..{}", lowest, highest), fmt::format("{}", field), doc);
  }
  void operator()(std::string_view name, bool& field, std::string_view doc) {
    add(name, "true or false", field ? "true" : "false", doc);
  }
  void operator()(std::string_view name, Choice& field, std::string_view doc) {
    add(name, fmt::format("{}", fmt::join(field.names, " | ")), field.value, doc);
  }
  SettingsMap map;
  std::vector<render::SettingDoc> docs;

 private:
  void add(std::string_view name, std::string type, std::string value, std::string_view doc) {
    docs.push_back({std::string(name), std::move(type), value, std::string(doc)});
    map.emplace(name, std::move(value));
  }
};

template <class Settings>
Result<Settings> parse_settings(const SettingsMap& map) {
  Settings settings;
  SettingsReader reader(map);
  settings.fields(reader);
  CANDELA_TRY(reader.finish());
  return settings;
}

template <class Settings>
SettingsWriter write_settings(Settings settings) {
  SettingsWriter writer;
  settings.fields(writer);
  return writer;
}

}  // namespace candela::integrators
