// The program's commands as data, read from its parser. Everything that describes the commands (the reference
// in docs/cli.md, man pages, shell completion) is made from this, so that none of it can differ from the
// parser.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace candela::client {

struct OptionEntry {
  std::vector<std::string> names;  // "-o", "--output"; empty: a positional argument
  std::string value;               // "FILE"; empty: a flag
  std::string text;
  bool required = false;
  bool repeated = false;

  bool positional() const { return names.empty(); }
};

struct CommandEntry {
  std::string name;  // "render"; of a command within another both: "inspect falsecolor"
  std::string text;
  std::vector<std::string> examples;  // whole command lines
  std::vector<OptionEntry> options;

  // "candela render SCENE"
  std::string usage() const;
  // "inspect" of "inspect falsecolor"; empty for most.
  std::string group() const {
    const std::size_t blank = name.find(' ');
    return blank == std::string::npos ? std::string() : name.substr(0, blank);
  }
};

// The parsers of all commands with their names, in their order. A command that has commands within it is
// itself none.
std::vector<std::pair<std::string, CLI::App*>> commands_of(CLI::App& app);

// The commands of those that are not hidden.
std::vector<CommandEntry> visible_commands(CLI::App& app);

// Gives every command of `app` the examples at the end of its --help. Precondition: all commands are added.
void add_examples(CLI::App& app);

}  // namespace candela::client
