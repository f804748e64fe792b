#include "worker/film/filter.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>

#include "worker/core/math.h"

namespace candela::film {
namespace {

constexpr std::size_t kGaussianKnots = 513;  // of the tabulated density, over the whole support
constexpr std::size_t kKnotsPerPixel = 256;  // of filters with kinks at whole pixels
constexpr double kMaxLobes = 32;

// The number in a setting, NaN where it is none.
double number_setting(const SettingsMap& settings, const std::string& name, double otherwise) {
  const auto found = settings.find(name);
  if (found == settings.end()) return otherwise;
  double value = 0;
  const std::string& text = found->second;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() && end == text.data() + text.size() ? value
                                                                 : std::numeric_limits<double>::quiet_NaN();
}

Error setting_error(const SettingsMap& settings, const std::string& name, std::string_view wanted) {
  return usage_error(fmt::format("'{}' is not {}", settings.at(name), wanted)).with_field("filter " + name);
}

Result<double> positive_setting(const SettingsMap& settings, const std::string& name, double otherwise) {
  const double value = number_setting(settings, name, otherwise);
  if (!(value > 0) || !(value <= 64))
    return setting_error(settings, name, "a number of pixels above 0 and up to 64");
  return value;
}

Result<double> spline_setting(const SettingsMap& settings, const std::string& name) {
  const double value = number_setting(settings, name, 1.0 / 3);
  if (!(std::fabs(value) <= 8)) return setting_error(settings, name, "a number from -8 to 8");
  return value;
}

// sin(pi x) / (pi x), in double from the series that float results are made of (1e-10).
double sinc(double x) {
  const double a = std::numbers::pi * std::fabs(x);
  if (a < 1e-6) return 1;
  std::uint64_t quadrant = 0;
  const double r = math::detail::reduce_quadrant(a, quadrant);
  const double s = (quadrant & 1) != 0 ? math::detail::cos_kernel(r) : math::detail::sin_kernel(r);
  return ((quadrant & 2) != 0 ? -s : s) / a;
}

double polynomial(const double (&c)[4], double x) {
  return c[0] + x * (c[1] + x * (c[2] + x * c[3]));
}

}  // namespace

Result<PixelFilter> PixelFilter::create(const std::string& name, const SettingsMap& settings) {
  PixelFilter filter;
  std::vector<std::string> known;
  if (name == "box") {
    known = {"radius"};
    filter.kind_ = Kind::box;
    CANDELA_ASSIGN(filter.radius_, positive_setting(settings, "radius", 0.5));
    filter.norm_ = 1 / (2 * filter.radius_);
  } else if (name == "tent") {
    known = {"radius"};
    filter.kind_ = Kind::tent;
    CANDELA_ASSIGN(filter.radius_, positive_setting(settings, "radius", 1.0));
    filter.norm_ = 1 / filter.radius_;
  } else if (name == "gaussian") {
    known = {"stddev"};
    filter.kind_ = Kind::gaussian;
    CANDELA_ASSIGN(const double stddev, positive_setting(settings, "stddev", 0.5));
    // Mitsuba: exp(-x^2 / 2 s^2) - exp(-r^2 / 2 s^2), r = 4 s.
    filter.radius_ = 4 * stddev;
    filter.exponent_ = -1 / (2 * stddev * stddev);
    filter.edge_ = math::exp(filter.exponent_ * filter.radius_ * filter.radius_);
    filter.tabulate(kGaussianKnots);
  } else if (name == "mitchell" || name == "catmullrom") {
    filter.kind_ = Kind::cubic;
    filter.radius_ = 2;
    double b = 0, c = 0.5;
    if (name == "mitchell") {
      known = {"B", "C"};
      CANDELA_ASSIGN(b, spline_setting(settings, "B"));
      CANDELA_ASSIGN(c, spline_setting(settings, "C"));
    }
    // [Mitchell 1988, Eq. 8]
    const double inner[4] = {6 - 2 * b, 0, -18 + 12 * b + 6 * c, 12 - 9 * b - 6 * c};
    const double outer[4] = {8 * b + 24 * c, -12 * b - 48 * c, 6 * b + 30 * c, -b - 6 * c};
    for (std::size_t i = 0; i < 4; ++i) {
      filter.inner_[i] = inner[i] / 6;
      filter.outer_[i] = outer[i] / 6;
    }
    filter.tabulate(4 * kKnotsPerPixel + 1);
  } else if (name == "lanczos") {
    known = {"lobes"};
    filter.kind_ = Kind::lanczos;
    filter.radius_ = number_setting(settings, "lobes", 3);
    if (!(filter.radius_ >= 1 && filter.radius_ <= kMaxLobes) ||
        filter.radius_ != std::floor(filter.radius_)) {
      return setting_error(settings, "lobes", "a whole number from 1 to 32");
    }
    filter.tabulate(2 * static_cast<std::size_t>(filter.radius_) * kKnotsPerPixel + 1);
  } else {
    return usage_error(fmt::format("unknown filter '{}'", name))
        .with_field("filter")
        .with_mend("there is box, tent, gaussian, mitchell, catmullrom, lanczos");
  }
  for (const auto& [key, value] : settings) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    std::string names;
    for (const std::string& one : known) names.append(names.empty() ? "" : ", ").append(one);
    return usage_error(fmt::format("the {} filter has no setting '{}'", name, key))
        .with_field("filter")
        .with_mend(names.empty() ? "it has none" : fmt::format("it has {}", names));
  }
  return filter;
}

// The density is |f| at the knots, linear between them: it is above zero wherever f is not zero. Where f
// changes its sign within a cell, the density is above |f| there.
void PixelFilter::tabulate(std::size_t knots) {
  pdf_.resize(knots);
  cdf_.assign(knots, 0.0);
  const double step = 2 * radius_ / static_cast<double>(knots - 1);
  // The integral of the filter itself by Simpson's rule on a much finer grid (error below 1e-12), the table
  // by trapezoids.
  constexpr int kFine = 1 << 14;
  double integral = 0;
  for (int i = 0; i <= kFine; ++i) {
    const double factor = i == 0 || i == kFine ? 1 : i % 2 == 1 ? 4 : 2;
    integral += factor * eval_1d(-radius_ + 2 * radius_ * i / kFine);
  }
  integral *= 2 * radius_ / kFine / 3;
  for (std::size_t i = 0; i < knots; ++i) {
    const double value = eval_1d(-radius_ + step * static_cast<double>(i));
    negative_lobes_ = negative_lobes_ || value < -1e-9;
    pdf_[i] = std::fabs(value);
  }
  norm_ = 1 / integral;
  for (std::size_t i = 1; i < knots; ++i) cdf_[i] = cdf_[i - 1] + 0.5 * step * (pdf_[i - 1] + pdf_[i]);
  const double total = cdf_.back();
  for (std::size_t i = 0; i < knots; ++i) {
    pdf_[i] /= total;
    cdf_[i] /= total;
  }
  // A power of two: its steps begin at exact values of u.
  guide_.resize(std::bit_ceil(2 * knots));
  std::size_t at = 0;
  for (std::size_t k = 0; k < guide_.size(); ++k) {
    const double u = static_cast<double>(k) / static_cast<double>(guide_.size());
    while (at + 2 < knots && cdf_[at + 1] <= u) ++at;
    guide_[k] = static_cast<std::uint16_t>(at);
  }
}

// The last knot, but for the last of all, whose cumulative is at most u: from that of the guide's step on,
// since a binary search mispredicts half of its branches.
std::size_t PixelFilter::cell(double u) const {
  const auto step = static_cast<std::size_t>(u * static_cast<double>(guide_.size()));
  std::size_t i = guide_[std::min(step, guide_.size() - 1)];
  while (i + 2 < cdf_.size() && cdf_[i + 1] <= u) ++i;
  return i;
}

double PixelFilter::eval_1d(double x) const {
  const double distance = std::fabs(x);
  if (distance > radius_) return 0;
  switch (kind_) {
    case Kind::box:
      return norm_;
    case Kind::tent:
      return norm_ * (1 - distance / radius_);
    case Kind::gaussian:
      return norm_ * std::max(0.0, math::exp(exponent_ * x * x) - edge_);
    case Kind::cubic:
      return norm_ * (distance < 1 ? polynomial(inner_, distance) : polynomial(outer_, distance));
    case Kind::lanczos:
      return norm_ * sinc(distance) * sinc(distance / radius_);
  }
  return 0;
}

double PixelFilter::pdf_1d(double x) const {
  if (pdf_.empty()) return eval_1d(x);
  if (std::fabs(x) > radius_) return 0;
  const double place = (x + radius_) / (2 * radius_) * static_cast<double>(pdf_.size() - 1);
  const auto i = std::min(static_cast<std::size_t>(place), pdf_.size() - 2);
  const double t = place - static_cast<double>(i);
  return pdf_[i] + t * (pdf_[i + 1] - pdf_[i]);
}

float PixelFilter::sample_1d(float u, float& weight) const {
  switch (kind_) {
    case Kind::box:
      return static_cast<float>(radius_) * (2 * u - 1);
    case Kind::tent: {
      // Inverse of the tent's cumulative, one side at a time.
      const float r = static_cast<float>(radius_);
      return u < 0.5f ? r * (std::sqrt(2 * u) - 1) : r * (1 - std::sqrt(2 * (1 - u)));
    }
    case Kind::gaussian:
    case Kind::cubic:
    case Kind::lanczos: {
      const std::size_t i = cell(static_cast<double>(u));
      // Within a cell the density is linear: solve the quadratic for the cumulative, in the form that does
      // not cancel.
      const double step = 2 * radius_ / static_cast<double>(pdf_.size() - 1);
      const double a = pdf_[i], slope = (pdf_[i + 1] - pdf_[i]) / step;
      const double area = std::max(0.0, static_cast<double>(u) - cdf_[i]);
      const double root = std::sqrt(std::max(0.0, a * a + 2 * slope * area));
      const double t = a + root > 0 ? std::min(step, 2 * area / (a + root)) : 0.5 * step;
      const double x = -radius_ + step * static_cast<double>(i) + t;
      const double pdf = pdf_1d(x);
      if (pdf > 0) weight *= static_cast<float>(eval_1d(x) / pdf);
      return static_cast<float>(x);
    }
  }
  return 0;
}

Vec2 PixelFilter::sample(Vec2 u, float& weight) const {
  weight = 1;
  const float x = sample_1d(u.x, weight);
  const float y = sample_1d(u.y, weight);
  return {x, y};
}

}  // namespace candela::film
