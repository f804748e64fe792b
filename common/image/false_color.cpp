#include "common/image/false_color.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>

#include "common/image/formats.h"

namespace candela::image {
namespace {

constexpr Color8 kPaper = {255, 255, 255}, kInk = {0, 0, 0};

bool has_color(float value, bool logarithmic) {
  return std::isfinite(value) && (!logarithmic || value > 0);
}

// Returns the value at a fractional rank among 0 to n - 1; reorders the values.
double at_rank(std::vector<float>& values, double rank) {
  const auto below = static_cast<std::ptrdiff_t>(rank);
  const auto lower = values.begin() + below;
  std::nth_element(values.begin(), lower, values.end());
  const double fraction = rank - static_cast<double>(below), value = *lower;
  if (!(fraction > 0)) return value;
  return value + fraction * (*std::min_element(lower + 1, values.end()) - value);
}

ColorScale around(double value, bool logarithmic) {
  if (logarithmic) return {value / 2, value * 2, true};
  if (value == 0) return {0, 1, false};
  return {value - std::abs(value) / 2, value + std::abs(value) / 2, false};
}

void paint(Figure& figure, std::span<const float> values, ColorMap map, const ColorScale& scale) {
  const Color8 not_positive = not_positive_color(map);
  for (std::uint32_t y = 0; y < figure.picture.height; ++y)
    for (std::uint32_t x = 0; x < figure.picture.width; ++x) {
      const float value = values[std::size_t{y} * figure.picture.width + x];
      const Color8 color = !std::isfinite(value)                 ? kNotFiniteColor
                           : has_color(value, scale.logarithmic) ? color_at(map, scale.position(value))
                                                                 : not_positive;
      figure.canvas.set(figure.picture.x + x, figure.picture.y + y, color);
    }
}

// The bar. An end is drawn as an arrow if numbers lie beyond it.
void paint_bar(Canvas& canvas, const PixelBox& bar, ColorMap map, bool arrow_low, bool arrow_high,
               double line) {
  const double half = bar.height / 2.0, middle = bar.y + half, length = 0.9 * bar.height;
  const double left = bar.x, right = bar.x + bar.width;
  const auto shaft = static_cast<std::uint32_t>(std::ceil(length));
  for (std::uint32_t x = bar.x - (arrow_low ? shaft : 0); x < bar.x + bar.width + (arrow_high ? shaft : 0);
       ++x) {
    const double center = x + 0.5;
    const double beyond = std::max({left - center, center - right, 0.0});
    const double reach = half * (1 - beyond / length);
    const Color8 color = color_at(map, (center - left) / bar.width);
    for (std::uint32_t y = bar.y; y < bar.y + bar.height; ++y)
      canvas.blend(x, y, color, std::clamp(reach + 0.5 - std::abs(y + 0.5 - middle), 0.0, 1.0));
  }
  const double top = bar.y, bottom = bar.y + bar.height;
  std::vector<Point2> outline = {{left, top}, {right, top}};
  if (arrow_high) outline.push_back({right + length, middle});
  outline.insert(outline.end(), {{right, bottom}, {left, bottom}});
  if (arrow_low) outline.push_back({left - length, middle});
  outline.push_back({left, top});
  for (std::size_t i = 1; i < outline.size(); ++i)
    draw_line(canvas, std::span(&outline[i - 1], 2), line, kInk);
}

struct LegendEntry {
  Color8 color;
  std::string text;
};

std::vector<LegendEntry> legend_of(const ValueSummary& summary, ColorMap map) {
  std::vector<LegendEntry> legend;
  const auto add = [&](Color8 color, const char* what, std::uint64_t count) {
    if (count > 0)
      legend.push_back(
          {color, std::string(what) + ": " + std::to_string(count) + (count == 1 ? " pixel" : " pixels")});
  };
  add(not_positive_color(map), "0 or less", summary.not_positive);
  add(kNotFiniteColor, "not finite", summary.not_finite);
  return legend;
}

// Sizes of the scale, all from the size of its text.
struct Layout {
  explicit Layout(std::uint32_t picture_width)
      : em(std::clamp(picture_width / 32.0, 12.0, 64.0)),
        capital(std::round(0.62 * em)),
        line(std::max(1.0, std::round(em / 14))),
        width(std::max(picture_width, static_cast<std::uint32_t>(20 * em))) {}

  double em, capital, line;
  std::uint32_t width;
};

}  // namespace

double ColorScale::position(double value) const {
  if (logarithmic) return (std::log(value) - std::log(low)) / (std::log(high) - std::log(low));
  return (value - low) / (high - low);
}

double ColorScale::value_at(double position) const {
  if (logarithmic) return std::exp(std::log(low) * (1 - position) + std::log(high) * position);
  return low * (1 - position) + high * position;
}

ValueSummary summarize(std::span<const float> values, const ColorScale& scale) {
  ValueSummary summary;
  summary.pixels = values.size();
  summary.minimum = std::numeric_limits<double>::infinity();
  summary.maximum = -summary.minimum;
  double sum = 0;
  for (const float value : values) {
    if (!std::isfinite(value)) {
      ++summary.not_finite;
      continue;
    }
    sum += value;
    summary.minimum = std::min(summary.minimum, double{value});
    summary.maximum = std::max(summary.maximum, double{value});
    if (!has_color(value, scale.logarithmic))
      ++summary.not_positive;
    else if (value < scale.low)
      ++summary.below;
    else if (value > scale.high)
      ++summary.above;
  }
  const std::uint64_t finite = summary.pixels - summary.not_finite;
  summary.mean = finite == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(finite);
  if (finite == 0) summary.minimum = summary.maximum = summary.mean;
  return summary;
}

Result<ColorScale> percentile_scale(std::span<const float> values, double low, double high, bool logarithmic,
                                    bool is_signed) {
  std::vector<float> shown;
  shown.reserve(values.size());
  for (const float value : values)
    if (has_color(value, logarithmic)) shown.push_back(value);
  if (shown.empty())
    return input_error(logarithmic ? "no pixel has a finite value above 0" : "no pixel has a finite value");
  const auto last = static_cast<double>(shown.size() - 1);
  ColorScale scale{at_rank(shown, low / 100 * last), at_rank(shown, high / 100 * last), logarithmic};
  if (is_signed) {
    double largest = std::max(std::abs(scale.low), std::abs(scale.high));
    if (largest == 0)
      for (const float value : shown) largest = std::max(largest, std::abs(double{value}));
    if (largest == 0) largest = 1;
    return ColorScale{-largest, largest, false};
  }
  if (scale.low < scale.high) return scale;
  const auto [smallest, largest] = std::minmax_element(shown.begin(), shown.end());
  if (*smallest < *largest) return ColorScale{*smallest, *largest, logarithmic};
  return around(*smallest, logarithmic);
}

Color8 not_positive_color(ColorMap map) {
  if (map == ColorMap::grey) return {40, 60, 160};
  return {128, 128, 128};
}

Figure draw_false_color(std::span<const float> values, std::uint32_t width, std::uint32_t height,
                        ColorMap map, const ColorScale& scale, const ValueSummary& summary,
                        const std::string& title) {
  const Layout layout(width);
  const double em = layout.em;
  const auto whole = [](double pixels) { return static_cast<std::uint32_t>(std::lround(pixels)); };
  const std::uint32_t margin = whole(2.2 * em);
  const PixelBox bar{margin, height + whole(0.8 * em), layout.width - 2 * margin, whole(0.95 * em)};
  const double tick_length = 0.3 * em;
  const double labels = bar.y + bar.height + 0.55 * em + layout.capital;  // baselines
  const double names = labels + 0.75 * em + layout.capital;
  const std::vector<LegendEntry> legend = legend_of(summary, map);
  const double legend_step = 0.6 * em + layout.capital;
  const double end = names + static_cast<double>(legend.size()) * legend_step + 0.6 * em;
  Figure figure{
      Canvas(layout.width, whole(end), kPaper), {(layout.width - width) / 2, 0, width, height}, bar};
  Canvas& canvas = figure.canvas;
  paint(figure, values, map, scale);
  paint_bar(canvas, bar, map, summary.below > 0, summary.above > 0, layout.line);

  const double bottom = bar.y + bar.height;
  const Ticks ticks = ticks_of(scale, bar.width, layout.capital);
  // On the centers of pixels a line of one pixel is sharp.
  const auto draw_tick = [&](double value, double length) {
    const double x = std::floor(bar.x + scale.position(value) * bar.width - 0.25) + 0.5;
    const Point2 line[] = {{x, bottom}, {x, bottom + length}};
    draw_line(canvas, line, layout.line, kInk);
  };
  for (const double value : ticks.minor) draw_tick(value, tick_length / 2);
  for (const Tick& tick : ticks.labeled) {
    draw_tick(tick.value, tick_length);
    const double x = bar.x + scale.position(tick.value) * bar.width;
    draw_text(canvas, x - text_width(tick.label, layout.capital) / 2, labels, layout.capital, tick.label,
              kInk);
  }
  Label power;
  if (ticks.exponent != 0) power = {" (x 10", std::to_string(ticks.exponent)};
  const double taken = text_width(power, layout.capital) + 2 * em;
  Label name{fit_text(title, layout.capital, layout.width - taken) + power.base, power.raised};
  const double name_width = text_width(name, layout.capital);
  const double name_x = (layout.width - name_width) / 2;
  draw_text(canvas, name_x, names, layout.capital, name, kInk);
  if (ticks.exponent != 0)
    draw_text(canvas, name_x + name_width + 0.05 * em, names, layout.capital, {")"}, kInk);
  double baseline = names + legend_step;
  for (const LegendEntry& entry : legend) {
    const double whole_width = 1.4 * layout.capital + text_width({entry.text}, layout.capital);
    const double x = (layout.width - whole_width) / 2;
    for (double py = std::round(baseline - layout.capital); py < baseline; ++py)
      for (double px = std::round(x); px < std::round(x) + layout.capital; ++px)
        canvas.set(static_cast<std::uint32_t>(px), static_cast<std::uint32_t>(py), entry.color);
    draw_text(canvas, x + 1.5 * layout.capital, baseline, layout.capital, {entry.text}, kInk);
    baseline += legend_step;
  }
  return figure;
}

Result<std::string> encode_png(const Canvas& canvas) {
  try {
    const ImageSpec spec{.width = static_cast<int>(canvas.width),
                         .height = static_cast<int>(canvas.height),
                         .channels = {"R", "G", "B"},
                         .texts = {}};
    return write_png(spec, [&](int begin, int end, void* out) {
      const std::size_t row = std::size_t{canvas.width} * 3;
      std::copy_n(&canvas.rgb[static_cast<std::size_t>(begin) * row],
                  static_cast<std::size_t>(end - begin) * row, static_cast<std::uint8_t*>(out));
    });
  } catch (const std::bad_alloc&) {
    return resource_error("the picture to encode does not fit into memory");
  } catch (const std::exception& problem) {
    return failed_error("cannot encode the picture as PNG: " + one_line(problem.what()));
  }
}

}  // namespace candela::image
