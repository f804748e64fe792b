// Settings by precedence: command line > environment (CANDELA_*) > ~/.config/candela/config.toml > /etc/candela/config.toml.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "common/base/result.h"

namespace candela {

class Config {
 public:
  // Reads the files that exist ($XDG_CONFIG_HOME is honoured; $CANDELA_CONFIG replaces both). A file that does not parse is an error with
  // its line; keys are "section.key" or "key", values strings, numbers or booleans.
  static Result<Config> load();
  // Environment CANDELA_<NAME> (dots and dashes become underscores, upper case), else the files. Where the value came
  // from is told by origin() for error messages.
  std::optional<std::string> get(const std::string& key) const;
  std::string origin(const std::string& key) const;  // "$CANDELA_MASTER" or "/home/u/.config/candela/config.toml:3"

 private:
  struct Entry {
    std::string value, origin;
  };
  std::map<std::string, Entry> entries_;
};

}  // namespace candela
