#include "tests/proofs/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "common/base/hash.h"

namespace candela::proofs {
namespace {

constexpr std::string_view kBuild = "# build: ";

std::string check_of(const Line& line) {
  return sha256_hex(fmt::format("{} {} {} {}", line.test, line.films, line.judge, line.commit)).substr(0, 8);
}

}  // namespace

const Line* Table::find(std::string_view test) const {
  const auto found =
      std::find_if(lines.begin(), lines.end(), [&](const Line& line) { return line.test == test; });
  return found == lines.end() ? nullptr : &*found;
}

std::string line_text(const Line& line) {
  return fmt::format("{} {} {} {} {}", line.test, line.films, line.judge, line.commit, check_of(line));
}

Result<Table> read_table(const std::string& path) {
  std::ifstream in(path);
  if (!in) return input_error("cannot be read").at(path, 0);
  Table table;
  std::string text;
  for (int number = 1; std::getline(in, text); ++number) {
    if (text.starts_with(kBuild)) table.build = text.substr(kBuild.size());
    if (text.empty() || text[0] == '#') continue;
    Line line;
    std::string check, more;
    std::istringstream words(text);
    words >> line.test >> line.films >> line.judge >> line.commit >> check;
    if (check.empty() || words >> more)
      return input_error("not TEST FILMS JUDGE COMMIT CHECK: let tests/nightly/prove write this line")
          .at(path, number);
    if (check != check_of(line))
      return input_error(fmt::format("the line of {} was not written by tests/nightly/prove", line.test))
          .at(path, number);
    if (table.find(line.test) != nullptr)
      return input_error(fmt::format("{} stands here twice: remove a line", line.test)).at(path, number);
    table.lines.push_back(std::move(line));
  }
  return table;
}

std::string this_build() {
  return fmt::format("GCC {}.{}.{}, {}", __GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__, CANDELA_ARCH_NAME);
}

}  // namespace candela::proofs
