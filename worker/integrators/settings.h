// Settings of integrators: one struct each, whose fields() names every field once; parsing, printing,
// validation and docs all walk that list.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"

namespace candela::integrators {

// A setting for --help, docs and validation.
struct SettingDoc {
  std::string name, type, default_value, doc;
};

// A field that is one of a closed set of names.
struct Choice {
  std::string value;
  std::vector<std::string_view> names;
};

// A field that is some of a closed set of names, at least one, each once: "a,b".
struct NameList {
  std::vector<std::string> values;
  std::vector<std::string_view> names;
  bool has(std::string_view name) const {
    return std::find(values.begin(), values.end(), name) != values.end();
  }
};

// A field that is a real number from lowest to highest, lowest itself left out if `above`, highest if
// `below`.
struct NumberRange {
  double lowest, highest;
  bool above = false, below = false;
};

// Visitor that reads fields from text and remembers what it consumed.
class SettingsReader {
 public:
  explicit SettingsReader(const SettingsMap& map) : map_(map) {}
  void operator()(std::string_view name, int& field, int lowest, int highest, std::string_view doc);
  void operator()(std::string_view name, double& field, NumberRange range, std::string_view doc);
  void operator()(std::string_view name, bool& field, std::string_view doc);
  void operator()(std::string_view name, Choice& field, std::string_view doc);
  void operator()(std::string_view name, NameList& field, std::string_view doc);
  // A setting that others have and this integrator does not: an error if it is given.
  void absent(std::string_view name, std::string_view why, std::string_view mend);
  // A setting that is gone: jobs of earlier versions may give it, with the value that stands for what is done
  // now; another one is an error.
  void retired(std::string_view name, std::string_view value, std::string_view why);
  // After all fields: an error for a bad value, or for a key that no field took.
  Result<void> finish() const;

 private:
  const std::string* take(std::string_view name);
  void fail(std::string_view name, std::string message);

  const SettingsMap& map_;
  std::vector<std::string> known_;
  std::vector<std::string_view> retired_;  // of those given
  bool ok_ = true;
  Error error_;
};

// Visitor that writes fields out as text, and as documentation. Numbers are written with as many digits as
// it takes to read the same number back.
class SettingsWriter {
 public:
  void operator()(std::string_view name, int& field, int lowest, int highest, std::string_view doc);
  void operator()(std::string_view name, double& field, NumberRange range, std::string_view doc);
  void operator()(std::string_view name, bool& field, std::string_view doc);
  void operator()(std::string_view name, Choice& field, std::string_view doc);
  void operator()(std::string_view name, NameList& field, std::string_view doc);
  void absent(std::string_view /*name*/, std::string_view /*why*/, std::string_view /*mend*/) {}
  void retired(std::string_view /*name*/, std::string_view /*value*/, std::string_view /*why*/) {}
  SettingsMap map;
  std::vector<SettingDoc> docs;

 private:
  void add(std::string_view name, std::string type, std::string value, std::string_view doc);
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
