#include "worker/loaders/curves.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "common/base/work_monitor.h"

namespace candela::loaders {
namespace {

constexpr double kLargest = 1e18;

// The four numbers of a line; false: it holds something else. `count`: how many there are.
bool read_numbers(std::string_view line, std::array<double, 4>& out, std::size_t& count) {
  constexpr std::string_view kBlank = " \t\r,";
  count = 0;
  for (std::size_t at = line.find_first_not_of(kBlank); at != line.npos;
       at = line.find_first_not_of(kBlank, at)) {
    const std::size_t stop = std::min(line.find_first_of(kBlank, at), line.size());
    if (count == out.size()) return false;
    const auto [rest, code] = std::from_chars(line.data() + at, line.data() + stop, out[count]);
    if (code != std::errc() || rest != line.data() + stop || !(std::abs(out[count]) <= kLargest))
      return false;
    ++count;
    at = stop;
  }
  return true;
}

}  // namespace

Result<std::vector<Curve>> load_curves(std::string_view bytes, const std::string& name,
                                       std::size_t min_points) {
  std::vector<Curve> curves;
  Curve curve;
  int line_number = 0, first_line = 1;
  const auto end_curve = [&]() -> Result<void> {
    if (curve.empty()) return {};
    if (curve.size() < min_points)
      return input_error("the curve has " + std::to_string(curve.size()) + " control points, but needs " +
                         std::to_string(min_points))
          .at(name, first_line);
    curves.push_back(std::move(curve));
    curve.clear();
    return {};
  };
  while (!bytes.empty()) {
    work_step(static_cast<std::size_t>(line_number));
    const std::size_t stop = std::min(bytes.find('\n'), bytes.size());
    const std::string_view line = bytes.substr(0, stop);
    bytes.remove_prefix(std::min(stop + 1, bytes.size()));
    ++line_number;
    std::array<double, 4> numbers{};
    std::size_t count = 0;
    if (!read_numbers(line, numbers, count) || (count != 0 && count != numbers.size()))
      return input_error("a control point is four finite numbers: x y z radius").at(name, line_number);
    if (count == 0) {
      CANDELA_TRY(end_curve());
      continue;
    }
    if (numbers[3] < 0) return input_error("the radius is negative").at(name, line_number);
    if (curve.empty()) first_line = line_number;
    curve.push_back({{numbers[0], numbers[1], numbers[2]}, numbers[3]});
  }
  CANDELA_TRY(end_curve());
  if (curves.empty()) return input_error("the file holds no curve").at(name, 0);
  return curves;
}

}  // namespace candela::loaders
