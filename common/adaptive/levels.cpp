#include "common/adaptive/levels.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace candela::adaptive {
namespace {

Error constant_error(std::string_view name, std::string_view message) {
  return input_error(fmt::format("constant '{}' of the decision rule: {}", name, message))
      .with_field(fmt::format("work.epochs.constants.{}", name));
}

Result<std::string_view> get_text(const SettingsMap& constants, std::string_view name) {
  const auto found = constants.find(std::string(name));
  if (found == constants.end()) return constant_error(name, "is missing");
  return std::string_view(found->second);
}

std::string joined(const std::vector<std::string>& words, std::string_view separator) {
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : separator).append(word);
  return text;
}

template <class Number>
bool read_number(std::string_view text, Number& value) {
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() && end == text.data() + text.size();
}

// base^exponent, by products if the exponent is a small integer.
double raised(double base, double exponent) {
  if (exponent > 64 || exponent != std::floor(exponent)) return std::pow(base, exponent);
  double power = 1;
  for (int i = 0; i < static_cast<int>(exponent); ++i) power *= base;
  return power;
}

}  // namespace

int Levels::deepest(std::uint64_t iteration) const {
  if (floors.empty()) return max_level;
  return static_cast<int>(std::upper_bound(floors.begin(), floors.end(), iteration) - floors.begin());
}

std::vector<double> Levels::radii(double first) const {
  std::vector<double> radii(static_cast<std::size_t>(max_level) + 1);
  for (double& radius : radii) {
    radius = first;
    first *= factor;
  }
  return radii;
}

Levels levels_above(double factor, double min_radius, double alpha) {
  Levels levels{factor, 0};
  const double power = 2 / (1 - alpha);
  double radius = factor;
  for (int g = 1; g <= kMaxLevel; ++g, radius *= factor) {
    // radius >= min_radius (i + 1)^(-1 / power)  <=>  i + 1 >= (min_radius / radius)^power
    const double needed = raised(min_radius / radius, power);
    if (needed > static_cast<double>(Limits::max_iterations)) break;
    levels.floors.push_back(needed <= 1 ? 0 : static_cast<std::uint64_t>(std::ceil(needed)) - 1);
    levels.max_level = g;
  }
  return levels;
}

std::vector<std::uint64_t> levels_beside(double factor, double alpha, double to_alpha, int max_level) {
  std::vector<std::uint64_t> iterations;
  if (!(to_alpha < alpha)) return iterations;
  const double power = 2 / (to_alpha - alpha);
  for (int g = 1; g <= max_level; ++g) {
    const double first = std::pow(factor, (g - 0.5) * power);
    if (!(first <= static_cast<double>(Limits::max_iterations))) break;
    iterations.push_back(static_cast<std::uint64_t>(std::ceil(first)));
  }
  return iterations;
}

void put_levels(const Levels& levels, SettingsMap& constants) {
  constants["factor"] = constant_text(levels.factor);
  constants["max_level"] = std::to_string(levels.max_level);
  if (!levels.floors.empty()) constants["floors"] = iterations_text(levels.floors);
}

std::string iterations_text(const std::vector<std::uint64_t>& iterations) {
  std::vector<std::string> words;
  for (const std::uint64_t iteration : iterations) words.push_back(std::to_string(iteration));
  return joined(words, ",");
}

Result<std::vector<std::uint64_t>> get_iterations(const SettingsMap& constants, std::string_view name) {
  std::vector<std::uint64_t> iterations;
  const auto found = constants.find(std::string(name));
  if (found == constants.end()) return iterations;
  for (std::string_view rest = found->second; !rest.empty();) {
    const std::size_t end = std::min(rest.find(','), rest.size());
    std::uint64_t iteration = 0;
    if (!read_number(rest.substr(0, end), iteration)) return constant_error(name, "is no list of integers");
    iterations.push_back(iteration);
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return iterations;
}

Result<Levels> get_levels(const SettingsMap& constants) {
  Levels levels;
  CANDELA_ASSIGN(levels.factor, get_number(constants, "factor"));
  if (!(levels.factor > 0 && levels.factor < 1)) return constant_error("factor", "is not between 0 and 1");
  CANDELA_ASSIGN(const std::uint64_t max_level, get_integer(constants, "max_level"));
  if (max_level > kMaxLevel) return constant_error("max_level", fmt::format("is above {}", kMaxLevel));
  levels.max_level = static_cast<int>(max_level);
  if (!constants.contains("floors")) return levels;
  CANDELA_ASSIGN(levels.floors, get_iterations(constants, "floors"));
  if (levels.floors.size() != max_level || !std::is_sorted(levels.floors.begin(), levels.floors.end()))
    return constant_error("floors", "is not one iteration for each level from 1 on, in increasing order");
  return levels;
}

std::string constant_text(double value) {
  std::array<char, 32> buffer{};
  const auto [end, code] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return std::string(buffer.data(), code == std::errc() ? end : buffer.data());
}

Result<double> get_number(const SettingsMap& constants, std::string_view name) {
  CANDELA_ASSIGN(const std::string_view text, get_text(constants, name));
  double value = 0;
  if (!read_number(text, value) || !std::isfinite(value))
    return constant_error(name, fmt::format("'{}' is no number", text));
  return value;
}

Result<std::uint64_t> get_integer(const SettingsMap& constants, std::string_view name) {
  CANDELA_ASSIGN(const std::string_view text, get_text(constants, name));
  std::uint64_t value = 0;
  if (!read_number(text, value)) return constant_error(name, fmt::format("'{}' is no integer", text));
  return value;
}

std::uint64_t critical_integer(double value) {
  return static_cast<std::uint64_t>(std::floor(value * 0x1p32 + 0.5));
}

}  // namespace candela::adaptive
