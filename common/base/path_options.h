// Options that name files and folders: an empty name is an unset variable of a shell script, and an error.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace candela {

// True if the help calls an option's value by the name of a file or a folder.
inline bool names_a_path(const std::string& type) {
  constexpr std::array<std::string_view, 7> types = {"FILE", "DIR", "SCENE", "IN", "OUT", "A", "REFERENCE"};
  return std::find(types.begin(), types.end(), type) != types.end();
}

// Every option of `app` and of its commands whose value names a file or a folder refuses an empty one while
// the command line is parsed, before anything is done.
inline void refuse_empty_paths(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const std::string type = option->get_type_name();
    if (!names_a_path(type)) continue;
    const bool positional = option->get_positional();
    const std::string mend = positional ? "give " + type : "give a value, or leave the option out";
    option->check([mend](const std::string& value) {
      return value.empty() ? "the name of a file or folder is empty (" + mend +
                                 "; an unset variable in a script gives this)"
                           : std::string();
    });
  }
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) refuse_empty_paths(*command);
}

// The first argument of the form "--option=", whose value CLI11 would take from the next word; empty if there
// is none.
inline std::string option_without_value(const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (argument == "--") break;  // words after it are no options
    if (argument.size() > 3 && argument.starts_with("--") && argument.find('=') == argument.size() - 1)
      return argument;
  }
  return {};
}

}  // namespace candela
