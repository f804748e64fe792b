// Help wrapped to the width of a terminal.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace candela::client {

// Columns of the terminal on standard output, else $COLUMNS; nothing where neither is: help stays as it is.
std::optional<std::size_t> help_width();

// The help that the parser prints, with its lines at most so wide where they have blanks. The texts of
// options stay in their column; examples stay as they are.
std::string wrap_help(std::string_view help, std::size_t width);

// One paragraph, each line after `indent` blanks.
std::string wrap_text(std::string_view text, std::size_t indent, std::size_t width);

}  // namespace candela::client
