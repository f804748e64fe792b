#include <fmt/format.h>

#include <map>

#include "client/help/completion.h"
#include "client/values.h"

namespace candela::client {
namespace {

using Source = ValueKind::Source;

constexpr std::string_view kZshHead = R"zsh(#compdef candela
# Completion of candela for zsh, written by: candela completion zsh
_candela_first_column() {
  local -a found
  found=(${(f)"$(candela $1 --timeout 1s 2>/dev/null | awk 'NR > 1 { print $1 }')"})
  compadd -a found
}

_candela() {
  local -a commands
  commands=(
)zsh";

// A text within the brackets or between the colons of a specification.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string action(const ValueKind& kind) {
  std::string words;
  for (const std::string& word : kind.words) words += (words.empty() ? "" : " ") + word;
  switch (kind.source) {
    case Source::none:
      return "";
    case Source::words:
      return "(" + words + ")";
    case Source::files:
      return "_files";
    case Source::folders:
      return "_files -/";
    case Source::jobs:
      return "_candela_first_column list";
    case Source::workers:
      return "_candela_first_column workers";
  }
  return "";
}

std::string value_of(const OptionEntry& option, const Choices& choices) {
  return option.value.empty()
             ? std::string()
             : fmt::format(":{}:{}", escaped(option.value), action(value_kind(option, choices)));
}

// One specification of _arguments for each name of the option; `position` counts the arguments.
std::string specifications(const OptionEntry& option, const Choices& choices, int& position) {
  if (option.positional())
    return fmt::format(" \\\n        {}",
                       shell_quote(fmt::format("{}{}", ++position, value_of(option, choices))));
  std::string names, out;
  for (const std::string& name : option.names) names += (names.empty() ? "" : " ") + name;
  const std::string front = option.repeated ? "*" : "(" + names + ")";
  for (const std::string& name : option.names) {
    const std::string spelling = name + (option.value.empty() ? "" : name.starts_with("--") ? "=" : "+");
    out += fmt::format(" \\\n        {}",
                       shell_quote(fmt::format("{}{}[{}]{}", front, spelling, escaped(option.text),
                                               value_of(option, choices))));
  }
  return out;
}

}  // namespace

std::string zsh_completion(std::span<const CommandEntry> commands, const Choices& choices) {
  std::string script(kZshHead);
  std::map<std::string, std::string> groups;  // the commands within each, as _describe takes them
  for (const CommandEntry& command : commands) {
    const std::string group = command.group();
    if (!group.empty()) {
      if (groups[group].empty())
        script += fmt::format("    {}\n", shell_quote(group + ":commands of its own"));
      groups[group] += " " + shell_quote(command.name.substr(group.size() + 1) + ":" + escaped(command.text));
      continue;
    }
    script += fmt::format("    {}\n", shell_quote(command.name + ":" + escaped(command.text)));
  }
  script +=
      "  )\n  if ((CURRENT == 2)); then\n    _describe command commands\n    return\n  fi\n"
      "  local command=$words[2]\n  shift words\n  ((CURRENT--))\n";
  for (const auto& [group, within] : groups)
    script += fmt::format(
        "  if [[ $command == {0} ]]; then\n    if ((CURRENT == 2)); then\n      commands=({1})\n"
        "      _describe command commands\n      return\n    fi\n"
        "    command=\"{0} $words[2]\"\n    shift words\n    ((CURRENT--))\n  fi\n",
        group, within);
  script += "  case $command in\n";
  for (const CommandEntry& command : commands) {
    int position = 0;
    script += fmt::format("    {})\n      _arguments", shell_quote(command.name));
    for (const OptionEntry& option : command.options) script += specifications(option, choices, position);
    script += " ;;\n";
  }
  // Sourced, the script registers itself; as a file of $fpath it is the function's body.
  return script +
         "  esac\n}\n\nif [[ $funcstack[1] == _candela ]]; then\n  _candela \"$@\"\nelse\n"
         "  compdef _candela candela\nfi\n";
}

}  // namespace candela::client
