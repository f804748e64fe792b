// The CSV file of a study: a head of "# key: value" lines, the names of the columns, a line for each row.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/bench/candela_study/study.h"

namespace candela::study {

using Head = std::vector<std::pair<std::string, std::string>>;

// The same bytes for the same rows on every machine. A value that is not finite is an empty cell.
std::string csv_of(const Head& head, std::span<const Row> rows);

// A line for each map: its name, width, height, and its values with spaces between.
std::string csv_of(std::span<const Map> maps);

// The commit that the sources at `folder` are of, with "-changed" if files differ from it; empty if git does
// not know.
std::string commit_of(const std::string& folder);

}  // namespace candela::study
