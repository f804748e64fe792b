// Words of a command as a POSIX shell writes and reads them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela {

// A word as a POSIX shell reads it back, for commands we print.
std::string shell_quote(std::string_view word);
// Words, quoted and with spaces between.
std::string shell_line(const std::vector<std::string>& words);
// The words of what shell_line() made. Errors (input): a quote that does not end, or anything that a shell
// would not take as it stands.
Result<std::vector<std::string>> split_shell_line(std::string_view line);

}  // namespace candela
