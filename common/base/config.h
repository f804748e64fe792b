// Settings by precedence: command line > environment (CANDELA_*) > ~/.config/candela/config.toml >
// /etc/candela/config.toml.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace candela {

class Config {
 public:
  // Reads the files that exist ($XDG_CONFIG_HOME is honored; $CANDELA_CONFIG replaces both and must exist;
  // errors then have the variable as their field). A file that does not parse, and a value that is no string,
  // number or boolean, is an input error with its line. Keys are "section.key" or "key"; TOML's nesting
  // deeper than one section is refused.
  static Result<Config> load();
  // Environment CANDELA_<NAME> (dots and dashes become underscores, upper case; empty counts as unset), else
  // the files. Where the value came from is told by origin() for error messages.
  std::optional<std::string> get(const std::string& key) const;
  // "$CANDELA_MASTER" or "/home/u/.config/candela/config.toml:3"; empty if the key is set nowhere.
  std::string origin(const std::string& key) const;
  // An input error naming file, line and the nearest known name where the files' [section] holds a key not in
  // `known` (names without the section), so that a misspelt key is not ignored in silence.
  Result<void> check_section(const std::string& section, const std::vector<std::string>& known) const;
  // The same for what all programs share: a key outside every section that no program knows, and a section of
  // no program.
  Result<void> check_shared() const;

 private:
  struct Entry {
    std::string value, origin;
  };
  std::map<std::string, Entry> entries_;
};

}  // namespace candela
