#include <fmt/format.h>

#include <map>

#include "client/help/completion.h"
#include "client/values.h"

namespace candela::client {
namespace {

using Source = ValueKind::Source;

// bash has the value of --option=VALUE as words of its own: the option, "=" and the value.
constexpr std::string_view kBashHead =
    R"(# Completion of candela for bash, written by: candela completion bash
_candela_words() { mapfile -t COMPREPLY < <(compgen -W "$1" -- "$2"); }
_candela_files() { compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen "$1" -- "$2"); }
# Ids of jobs or workers. compgen would expand what looks like a substitution: only plain words pass.
_candela_first_column() {
  candela "$1" --timeout 1s 2>/dev/null | awk 'NR > 1 && $1 ~ /^[A-Za-z0-9_.-]+$/ { print $1 }'
}

_candela() {
  local current=${COMP_WORDS[COMP_CWORD]} option=${COMP_WORDS[COMP_CWORD-1]} command='' i
  local groups=%GROUPS%
  COMPREPLY=()
  if [[ $current == = ]]; then
    current=''
  elif [[ $option == = ]] && ((COMP_CWORD > 1)); then
    option=${COMP_WORDS[COMP_CWORD-2]}
  fi
  for ((i = 1; i < COMP_CWORD; ++i)); do
    if [[ ${COMP_WORDS[i]} != -* ]]; then
      command=${command:+$command }${COMP_WORDS[i]}
      [[ $groups == *" $command "* ]] || break
    fi
  done
  case $command in
)";

std::string complete(const ValueKind& kind) {
  std::string words;
  for (const std::string& word : kind.words) words += (words.empty() ? "" : " ") + word;
  switch (kind.source) {
    case Source::none:
      return ":";
    case Source::words:
      return fmt::format("_candela_words {} \"$current\"", shell_quote(words));
    case Source::files:
      return "_candela_files -f \"$current\"";
    case Source::folders:
      return "_candela_files -d \"$current\"";
    case Source::jobs:
      return "_candela_words \"$(_candela_first_column list)\" \"$current\"";
    case Source::workers:
      return "_candela_words \"$(_candela_first_column workers)\" \"$current\"";
  }
  return ":";
}

std::string command_case(const CommandEntry& command, const Choices& choices) {
  std::string values, options;
  std::string arguments = ":";  // of the positional ones the first decides
  for (const OptionEntry& option : command.options) {
    if (option.positional()) {
      if (arguments == ":") arguments = complete(value_kind(option, choices));
      continue;
    }
    std::string pattern;
    for (const std::string& name : option.names) {
      pattern += (pattern.empty() ? "" : "|") + name;
      options += (options.empty() ? "" : " ") + name;
    }
    if (!option.value.empty())
      values += fmt::format("        {}) {}; return ;;\n", pattern, complete(value_kind(option, choices)));
  }
  return fmt::format(
      "    {})\n      case $option in\n{}      esac\n"
      "      if [[ $current == -* ]]; then\n        _candela_words {} \"$current\"\n      else\n        {}\n"
      "      fi ;;\n",
      shell_quote(command.name), values, shell_quote(options), arguments);
}

}  // namespace

std::string bash_completion(std::span<const CommandEntry> commands, const Choices& choices) {
  std::string cases, names;
  std::map<std::string, std::string> groups;  // the commands within each
  for (const CommandEntry& command : commands) {
    if (const std::string group = command.group(); group.empty()) {
      names += command.name + " ";
    } else {
      if (groups[group].empty()) names += group + " ";
      groups[group] += command.name.substr(group.size() + 1) + " ";
    }
    cases += command_case(command, choices);
  }
  std::string group_names = " ";
  for (const auto& [group, within] : groups) {
    group_names += group + " ";
    cases += fmt::format("    {}) _candela_words {} \"$current\" ;;\n", shell_quote(group),
                         shell_quote(within + "--help"));
  }
  constexpr std::string_view mark = "%GROUPS%";
  std::string script(kBashHead);
  script.replace(script.find(mark), mark.size(), shell_quote(group_names));
  script += cases;
  script +=
      fmt::format("    '') _candela_words {} \"$current\" ;;\n", shell_quote(names + "--help --version"));
  return script + "  esac\n}\ncomplete -F _candela candela\n";
}

}  // namespace candela::client
