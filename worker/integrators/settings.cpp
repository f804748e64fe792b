#include "worker/integrators/settings.h"

#include <algorithm>
#include <charconv>

#include "common/description/vocabulary.h"

namespace candela::integrators {
namespace {

template <class Names>
std::string joined(const Names& names, std::string_view separator) {
  std::string text;
  for (const auto& name : names) {
    if (!text.empty()) text += separator;
    text += name;
  }
  return text;
}

std::string number_text(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

std::string range_text(NumberRange range) {
  const std::string lowest = number_text(range.lowest), highest = number_text(range.highest);
  if (range.below) return (range.above ? "above " : "from ") + lowest + " and below " + highest;
  if (range.above) return "above " + lowest + " and at most " + highest;
  return "from " + lowest + " to " + highest;
}

std::string in_quotes(const std::string& text) {
  return "'" + text + "'";
}

}  // namespace

const std::string* SettingsReader::take(std::string_view name) {
  known_.emplace_back(name);
  const auto found = map_.find(std::string(name));
  return found == map_.end() ? nullptr : &found->second;
}

void SettingsReader::fail(std::string_view name, std::string message) {
  if (ok_) error_ = usage_error(std::move(message)).with_field(std::string(name));
  ok_ = false;
}

void SettingsReader::operator()(std::string_view name, int& field, int lowest, int highest,
                                std::string_view /*doc*/) {
  const std::string* text = take(name);
  if (text == nullptr) return;
  int value = 0;
  const auto [end, code] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (code != std::errc() || end != text->data() + text->size() || value < lowest || value > highest) {
    fail(name, in_quotes(*text) + " is not an integer from " + std::to_string(lowest) + " to " +
                   std::to_string(highest));
    return;
  }
  field = value;
}

void SettingsReader::operator()(std::string_view name, double& field, NumberRange range,
                                std::string_view /*doc*/) {
  const std::string* text = take(name);
  if (text == nullptr) return;
  double value = 0;
  const auto [end, code] = std::from_chars(text->data(), text->data() + text->size(), value);
  const bool high_enough = range.above ? value > range.lowest : value >= range.lowest;
  if (code != std::errc() || end != text->data() + text->size() || !high_enough ||
      !(range.below ? value < range.highest : value <= range.highest)) {
    fail(name, in_quotes(*text) + " is not a number " + range_text(range));
    return;
  }
  field = value;
}

void SettingsReader::operator()(std::string_view name, bool& field, std::string_view /*doc*/) {
  const std::string* text = take(name);
  if (text == nullptr) return;
  if (*text != "true" && *text != "false") {
    fail(name, in_quotes(*text) + " is neither true nor false");
    return;
  }
  field = *text == "true";
}

void SettingsReader::operator()(std::string_view name, Choice& field, std::string_view /*doc*/) {
  const std::string* text = take(name);
  if (text == nullptr) return;
  if (std::find(field.names.begin(), field.names.end(), *text) == field.names.end()) {
    fail(name, in_quotes(*text) + " is not one of " + joined(field.names, ", "));
    return;
  }
  field.value = *text;
}

void SettingsReader::operator()(std::string_view name, NameList& field, std::string_view /*doc*/) {
  const std::string* text = take(name);
  if (text == nullptr) return;
  std::vector<std::string> values;
  for (std::size_t begin = 0; begin <= text->size();) {
    const std::size_t end = std::min(text->find(',', begin), text->size());
    std::string value = text->substr(begin, end - begin);
    if (std::find(field.names.begin(), field.names.end(), value) == field.names.end()) {
      fail(name, in_quotes(value) + " is not one of " + joined(field.names, ", "));
      return;
    }
    if (std::find(values.begin(), values.end(), value) != values.end()) {
      fail(name, in_quotes(value) + " is there twice");
      return;
    }
    values.push_back(std::move(value));
    begin = end + 1;
  }
  field.values = std::move(values);
}

void SettingsReader::absent(std::string_view name, std::string_view why, std::string_view mend) {
  if (ok_ && map_.contains(std::string(name))) {
    error_ = usage_error(std::string(why)).with_field(std::string(name)).with_mend(std::string(mend));
    ok_ = false;
  }
}

void SettingsReader::retired(std::string_view name, std::string_view value, std::string_view why) {
  const auto found = map_.find(std::string(name));
  if (found == map_.end()) return;
  retired_.push_back(name);
  if (!ok_ || found->second == value) return;
  error_ = usage_error(in_quotes(found->second) + " is no longer there: " + std::string(why))
               .with_field(std::string(name))
               .with_mend("leave it out");
  ok_ = false;
}

Result<void> SettingsReader::finish() const {
  if (!ok_) return Error(error_);
  for (const auto& [key, value] : map_) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end() ||
        std::find(retired_.begin(), retired_.end(), key) != retired_.end())
      continue;
    const std::vector<std::string_view> known(known_.begin(), known_.end());
    const std::string near(description::nearest_name(key, known));
    return usage_error("unknown integrator setting")
        .with_field(key)
        .with_mend(near.empty() ? "there are " + joined(known_, ", ") : "did you mean '" + near + "'?");
  }
  return {};
}

void SettingsWriter::add(std::string_view name, std::string type, std::string value, std::string_view doc) {
  docs.push_back({std::string(name), std::move(type), value, std::string(doc)});
  map.emplace(name, std::move(value));
}

void SettingsWriter::operator()(std::string_view name, int& field, int lowest, int highest,
                                std::string_view doc) {
  add(name, "integer " + std::to_string(lowest) + ".." + std::to_string(highest), std::to_string(field), doc);
}

void SettingsWriter::operator()(std::string_view name, double& field, NumberRange range,
                                std::string_view doc) {
  add(name, "number " + range_text(range), number_text(field), doc);
}

void SettingsWriter::operator()(std::string_view name, bool& field, std::string_view doc) {
  add(name, "true or false", field ? "true" : "false", doc);
}

void SettingsWriter::operator()(std::string_view name, Choice& field, std::string_view doc) {
  add(name, joined(field.names, " | "), field.value, doc);
}

void SettingsWriter::operator()(std::string_view name, NameList& field, std::string_view doc) {
  add(name, "some of " + joined(field.names, ","), joined(field.values, ","), doc);
}

}  // namespace candela::integrators
