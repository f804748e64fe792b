#include "common/base/result.h"

#include <fmt/format.h>

namespace candela {

std::string Error::to_string() const {
  std::string text;
  if (!file.empty()) text += line > 0 ? fmt::format("{}:{}: ", file, line) : fmt::format("{}: ", file);
  if (!field.empty()) text += fmt::format("{}: ", field);
  text += message;
  if (!mend.empty()) text += fmt::format(" ({})", mend);
  return text;
}

int Error::exit_code() const {
  switch (kind) {
    case ErrorKind::usage:
    case ErrorKind::input:
      return 2;
    case ErrorKind::unreachable:
      return 3;
    case ErrorKind::failed:
    case ErrorKind::refused:
    case ErrorKind::resource:
    case ErrorKind::internal:
      return 1;
  }
  return 1;
}

}  // namespace candela
