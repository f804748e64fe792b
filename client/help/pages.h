// Descriptions of the program as text: the reference, man pages, shell completion.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/help/command_tree.h"

namespace candela::client {

// docs/cli.md.
std::string help_markdown(std::span<const CommandEntry> commands);

// Pages of section 1 by the name of their file: candela.1, candela-render.1 ...
std::map<std::string, std::string> man_pages(std::span<const CommandEntry> commands);

// The words that an option's value may be, by the option's long name; nothing for options of any value.
using Choices = std::map<std::string, std::vector<std::string>>;

// Scripts that complete commands, options, and values: choices, file names, and the ids of jobs and workers,
// for which they call `candela list` and `candela workers`.
std::string bash_completion(std::span<const CommandEntry> commands, const Choices& choices);
std::string zsh_completion(std::span<const CommandEntry> commands, const Choices& choices);

}  // namespace candela::client
