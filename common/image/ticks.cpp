// Round numbers on a scale.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/image/false_color.h"

namespace candela::image {
namespace {

// Powers of ten beyond these are written as powers.
constexpr int kSmallestPlain = -3, kLargestPlain = 4;

int exponent_of(double value) {
  return static_cast<int>(std::floor(std::log10(value) + 1e-9));
}

// True if no two neighbors touch.
bool fit(const ColorScale& scale, const std::vector<Tick>& ticks, double length, double capital) {
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    const double distance = (scale.position(ticks[i].value) - scale.position(ticks[i - 1].value)) * length;
    const double room =
        (text_width(ticks[i].label, capital) + text_width(ticks[i - 1].label, capital)) / 2 + 1.6 * capital;
    if (distance < room) return false;
  }
  return true;
}

std::string plain(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, std::clamp(decimals, 0, 15));
  if (text.find_first_not_of("-0.") == std::string::npos) text.erase(0, text.starts_with('-') ? 1 : 0);
  return text;
}

// The ends alone, if no round numbers serve.
std::vector<Tick> ends_of(const ColorScale& scale) {
  return {{scale.low, {fmt::format("{:.4g}", scale.low)}}, {scale.high, {fmt::format("{:.4g}", scale.high)}}};
}

std::vector<Tick> multiples_of(double step, int step_exponent, const ColorScale& scale, int exponent) {
  std::vector<Tick> ticks;
  const double tolerance = 1e-9 * step;
  const double first = std::ceil((scale.low - tolerance) / step);
  const double last = std::floor((scale.high + tolerance) / step);
  if (!(last - first < 100)) return ticks;
  for (double k = first; k <= last; ++k) {
    const double value = std::clamp(k * step, scale.low, scale.high);
    ticks.push_back({value, {plain(k * step / std::pow(10.0, exponent), exponent - step_exponent)}});
  }
  return ticks;
}

Ticks linear_ticks(const ColorScale& scale, double length, double capital) {
  const double largest = std::max(std::abs(scale.low), std::abs(scale.high)), range = scale.high - scale.low;
  const int magnitude = exponent_of(largest);
  const int exponent = magnitude < kSmallestPlain || magnitude > kLargestPlain ? magnitude : 0;
  constexpr std::size_t kMaxTicks = 7;
  for (int power = exponent_of(range) - 1; power <= exponent_of(range); ++power)
    for (const int mantissa : {1, 2, 5}) {
      const double step = mantissa * std::pow(10.0, power);
      std::vector<Tick> ticks = multiples_of(step, power, scale, exponent);
      if (ticks.size() >= 2 && ticks.size() <= kMaxTicks && fit(scale, ticks, length, capital))
        return {std::move(ticks), {}, exponent};
    }
  return {ends_of(scale), {}, 0};
}

Label power_label(int mantissa, int exponent, bool powers) {
  if (!powers) return {plain(mantissa * std::pow(10.0, exponent), -exponent)};
  if (mantissa == 1) return {"10", std::to_string(exponent)};
  return {fmt::format("{}x10", mantissa), std::to_string(exponent)};
}

Ticks logarithmic_ticks(const ColorScale& scale, double length, double capital) {
  const int first = exponent_of(scale.low), last = exponent_of(scale.high);
  const double tolerance = 1e-9;
  const auto within = [&](double value) {
    return value >= scale.low * (1 - tolerance) && value <= scale.high * (1 + tolerance);
  };
  const auto number = [](int mantissa, int exponent) { return mantissa * std::pow(10.0, exponent); };
  std::vector<double> minor;
  for (int e = first; e <= last && last - first <= 12; ++e)
    for (int m = 1; m < 10; ++m)
      if (within(number(m, e))) minor.push_back(number(m, e));
  const bool powers = first < kSmallestPlain || last > kLargestPlain;
  const auto labeled = [&](std::initializer_list<int> mantissas, int every) {
    std::vector<Tick> ticks;
    for (int e = first; e <= last; ++e) {
      if (e % every != 0) continue;
      for (const int m : mantissas)
        if (within(number(m, e)))
          ticks.push_back({std::clamp(number(m, e), scale.low, scale.high), power_label(m, e, powers)});
    }
    return ticks;
  };
  const auto good = [&](const std::vector<Tick>& ticks) {
    return ticks.size() >= 2 && fit(scale, ticks, length, capital);
  };
  if (std::vector<Tick> ticks = labeled({1, 2, 5}, 1); good(ticks)) {
    if (ticks.size() > 2) return {std::move(ticks), std::move(minor), 0};
  }
  for (const int every : {1, 2, 3, 5, 10, 20})
    if (std::vector<Tick> ticks = labeled({1}, every); good(ticks)) {
      const double decade = length / std::log10(scale.high / scale.low);
      if (every > 1 || decade < 7 * capital) {
        minor.clear();
        for (int e = first; e <= last; ++e)
          if (within(number(1, e))) minor.push_back(number(1, e));
      }
      return {std::move(ticks), std::move(minor), 0};
    }
  Ticks linear = linear_ticks(scale, length, capital);  // a narrow scale
  if (linear.exponent != 0 || linear.labeled.size() < 3) linear.minor = std::move(minor);
  return linear;
}

}  // namespace

Ticks ticks_of(const ColorScale& scale, double length, double capital) {
  return scale.logarithmic ? logarithmic_ticks(scale, length, capital) : linear_ticks(scale, length, capital);
}

}  // namespace candela::image
