#include "tests/bench/candela_study/csv.h"

#include <fmt/format.h>
#include <stdio.h>

#include <array>
#include <cmath>
#include <memory>

#include "tests/bench/candela_bench/store.h"

namespace candela::study {
namespace {

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.9g}", value) : std::string();
}

// Output of a command; empty if it fails.
std::string output_of(const std::string& command) {
  struct Close {
    int* status;
    void operator()(FILE* pipe) const { *status = ::pclose(pipe); }
  };
  int status = -1;
  std::string text;
  {
    const std::unique_ptr<FILE, Close> pipe(::popen(command.c_str(), "r"), Close{&status});
    if (!pipe) return "";
    std::array<char, 256> buffer{};
    while (::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe.get()) != nullptr)
      text += buffer.data();
  }
  return status == 0 ? text : "";
}

}  // namespace

std::string csv_of(const Head& head, std::span<const Row> rows) {
  std::string text;
  for (const auto& [key, value] : head) text += "# " + key + ": " + value + '\n';
  text += bench::csv_line({"part", "problem", "method", "alpha", "n", "quantity", "value", "standard_error"});
  for (const Row& row : rows)
    text += bench::csv_line({row.part, row.problem, row.method, number(row.alpha), number(row.n),
                             row.quantity, number(row.value), number(row.standard_error)});
  return text;
}

std::string csv_of(std::span<const Map> maps) {
  std::string text = bench::csv_line({"name", "width", "height", "values"});
  for (const Map& map : maps) {
    std::string values;
    for (const float value : map.values) values += fmt::format("{}{:.6g}", values.empty() ? "" : " ", value);
    text += bench::csv_line({map.name, std::to_string(map.width), std::to_string(map.height), values});
  }
  return text;
}

std::string commit_of(const std::string& folder) {
  std::string quoted = "'";
  for (const char c : folder) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  quoted += "'";
  std::string commit = output_of("git -C " + quoted + " rev-parse HEAD 2>/dev/null");
  while (!commit.empty() && commit.back() == '\n') commit.pop_back();
  if (commit.empty()) return "";
  const std::string changed =
      output_of("git -C " + quoted + " status --porcelain --untracked-files=no 2>/dev/null");
  return changed.empty() ? commit : commit + "-changed";
}

}  // namespace candela::study
