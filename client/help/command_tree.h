// The program's commands as data, read from its parser. Everything that describes the commands (the reference
// in docs/cli.md, man pages, shell completion) is made from this, so that none of it can differ from the
// parser.
#pragma once

#include <string>
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
  std::string name;
  std::string text;
  std::vector<std::string> examples;  // whole command lines
  std::vector<OptionEntry> options;

  // "candela render SCENE"
  std::string usage() const;
};

// All but hidden commands, in their order.
std::vector<CommandEntry> visible_commands(const CLI::App& app);

// Gives every command of `app` the examples at the end of its --help. Precondition: all commands are added.
void add_examples(CLI::App& app);

}  // namespace candela::client
