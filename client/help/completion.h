// Facts about an option's value that the scripts of both shells need.
#pragma once

#include <string>
#include <vector>

#include "client/help/pages.h"

namespace candela::client {

// Completion of the value of an option or argument.
struct ValueKind {
  enum class Source { none, words, files, folders, jobs, workers };
  Source source = Source::none;
  std::vector<std::string> words;
};

ValueKind value_kind(const OptionEntry& option, const Choices& choices);

}  // namespace candela::client
