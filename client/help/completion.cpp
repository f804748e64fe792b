#include "client/help/completion.h"

#include "common/base/path_options.h"

namespace candela::client {

ValueKind value_kind(const OptionEntry& option, const Choices& choices) {
  using Source = ValueKind::Source;
  if (option.value.empty()) return {};
  if (!option.names.empty())
    if (const auto found = choices.find(option.names.back()); found != choices.end())
      return {Source::words, found->second};
  if (option.value == "SHELL") return {Source::words, {"bash", "zsh"}};
  if (option.value == "DIR") return {Source::folders, {}};
  if (names_a_path(option.value)) return {Source::files, {}};
  if (option.value.starts_with("ID") || option.value == "GROUP") return {Source::jobs, {}};
  if (option.value == "WORKER") return {Source::workers, {}};
  return {};
}

}  // namespace candela::client
