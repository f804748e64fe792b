#include "client/help/command_tree.h"

#include <CLI/CLI.hpp>
#include <sstream>

namespace candela::client {
namespace {

// The footer of a command is "Example:" and lines of two blanks and a command.
std::vector<std::string> examples_of(const CLI::App& command) {
  std::vector<std::string> examples;
  std::istringstream footer(command.get_footer());
  for (std::string line; std::getline(footer, line);)
    if (line.starts_with("  candela ")) examples.push_back(line.substr(2));
  return examples;
}

OptionEntry entry_of(const CLI::Option& option) {
  OptionEntry entry;
  entry.text = option.get_description();
  entry.required = option.get_required();
  entry.repeated = option.get_expected_max() > 1;
  if (option.get_positional() || option.get_items_expected_max() > 0) entry.value = option.get_type_name();
  if (option.get_positional()) return entry;
  for (const std::string& name : option.get_snames()) entry.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) entry.names.push_back("--" + name);
  return entry;
}

}  // namespace

std::string CommandEntry::usage() const {
  std::string line = "candela " + name;
  for (const OptionEntry& option : options)
    if (option.positional()) line += option.required ? " " + option.value : " [" + option.value + "]";
  return line;
}

std::vector<std::pair<std::string, CLI::App*>> commands_of(CLI::App& app) {
  std::vector<std::pair<std::string, CLI::App*>> commands;
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    const auto within = commands_of(*command);
    if (within.empty()) commands.emplace_back(command->get_name(), command);
    for (const auto& [name, inner] : within) commands.emplace_back(command->get_name() + ' ' + name, inner);
  }
  return commands;
}

std::vector<CommandEntry> visible_commands(CLI::App& app) {
  std::vector<CommandEntry> commands;
  for (const auto& [name, command] : commands_of(app)) {
    if (command->get_group().empty()) continue;
    CommandEntry entry{name, command->get_description(), examples_of(*command), {}};
    for (const CLI::Option* option : command->get_options()) entry.options.push_back(entry_of(*option));
    commands.push_back(std::move(entry));
  }
  return commands;
}

}  // namespace candela::client
