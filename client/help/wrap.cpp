#include "client/help/wrap.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <sstream>

namespace candela::client {
namespace {

constexpr std::size_t kColumn = 30;        // in which the parser begins the texts of options
constexpr std::size_t kMinWidth = 40;      // narrower is unreadable
constexpr std::size_t kMinTextWidth = 30;  // else texts go below their option
constexpr std::size_t kNarrowColumn = 6;

std::size_t blanks_before(std::string_view line) {
  return std::min(line.find_first_not_of(' '), line.size());
}

}  // namespace

std::optional<std::size_t> help_width() {
  struct winsize size {};
  if (::isatty(STDOUT_FILENO) == 1 && ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
    return size.ws_col;
  const char* columns = std::getenv("COLUMNS");
  if (columns == nullptr) return std::nullopt;
  const std::string_view text(columns);
  std::size_t width = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), width);
  if (error != std::errc() || end != text.data() + text.size() || width == 0) return std::nullopt;
  return width;
}

std::string wrap_text(std::string_view text, std::size_t indent, std::size_t width) {
  const std::size_t room = std::max(width, indent + 1) - indent;
  std::string out;
  while (!text.empty()) {
    std::size_t end = text.size();
    if (end > room) {
      end = text.rfind(' ', room);
      if (end == std::string_view::npos || end == 0) end = std::min(text.find(' ', room), text.size());
    }
    out += std::string(indent, ' ') + std::string(text.substr(0, end)) + '\n';
    text.remove_prefix(std::min(text.find_first_not_of(' ', end), text.size()));
  }
  return out;
}

std::string wrap_help(std::string_view help, std::size_t width) {
  width = std::max(width, kMinWidth);
  const bool narrow = width < kColumn + kMinTextWidth;
  std::istringstream lines{std::string(help)};
  std::string out;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t before = blanks_before(line);
    if (line.size() <= width || line.starts_with("  candela ")) {
      out += line + '\n';
    } else if (before == 0) {
      out += wrap_text(line, 0, width);
    } else {
      // "  --option NAME   its text", or a text alone below an option.
      const std::size_t gap = before >= kColumn ? 0 : line.find("  ", before);
      const std::size_t begin =
          before >= kColumn ? before
                            : std::min(line.find_first_not_of(' ', std::min(gap, line.size())), line.size());
      const std::string name = before >= kColumn ? "" : line.substr(0, std::min(gap, line.size()));
      const std::size_t column = narrow ? kNarrowColumn : kColumn;
      std::string text = wrap_text(std::string_view(line).substr(begin), column, width);
      if (name.size() + 2 <= column && !name.empty())
        text.replace(0, name.size(), name);
      else if (!name.empty())
        out += name + '\n';
      out += text;
    }
  }
  return out;
}

}  // namespace candela::client
