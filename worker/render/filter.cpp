#include "worker/render/filter.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "worker/core/math.h"

namespace candela::render {
namespace {

constexpr int kKnots = 513;  // of the tabulated density, over the whole support

Result<double> positive_setting(const SettingsMap& settings, const std::string& name, double otherwise) {
  const auto found = settings.find(name);
  if (found == settings.end()) return otherwise;
  double value = 0;
  const std::string& text = found->second;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size() || !(value > 0) || !(value <= 64))
    return usage_error(fmt::format("'{}' is not a number of pixels above 0 and up to 64", text))
        .with_field("filter " + name);
  return value;
}

}  // namespace

Result<PixelFilter> PixelFilter::create(const std::string& name, const SettingsMap& settings) {
  PixelFilter filter;
  std::string known;
  if (name == "box") {
    known = "radius";
    filter.kind_ = Kind::box;
    CANDELA_ASSIGN(filter.radius_, positive_setting(settings, "radius", 0.5));
    filter.norm_ = 1 / (2 * filter.radius_);
  } else if (name == "tent") {
    known = "radius";
    filter.kind_ = Kind::tent;
    CANDELA_ASSIGN(filter.radius_, positive_setting(settings, "radius", 1.0));
    filter.norm_ = 1 / filter.radius_;
  } else if (name == "gaussian") {
    known = "stddev";
    filter.kind_ = Kind::gaussian;
    CANDELA_ASSIGN(const double stddev, positive_setting(settings, "stddev", 0.5));
    // Mitsuba: exp(-x^2 / 2 s^2) - exp(-r^2 / 2 s^2), r = 4 s.
    filter.radius_ = 4 * stddev;
    filter.exponent_ = -1 / (2 * stddev * stddev);
    filter.edge_ = math::exp(filter.exponent_ * filter.radius_ * filter.radius_);
    filter.pdf_.resize(kKnots);
    filter.cdf_.assign(kKnots, 0.0);
    const double step = 2 * filter.radius_ / (kKnots - 1);
    // The integral of the filter itself by Simpson's rule on a much finer grid (error below 1e-12), the table
    // by trapezoids.
    constexpr int kFine = 1 << 14;
    double integral = 0;
    for (int i = 0; i <= kFine; ++i) {
      const double factor = i == 0 || i == kFine ? 1 : i % 2 == 1 ? 4 : 2;
      integral += factor * filter.eval_1d(-filter.radius_ + 2 * filter.radius_ * i / kFine);
    }
    integral *= 2 * filter.radius_ / kFine / 3;
    for (int i = 0; i < kKnots; ++i)
      filter.pdf_[static_cast<std::size_t>(i)] = filter.eval_1d(-filter.radius_ + step * i);
    filter.norm_ = 1 / integral;
    for (std::size_t i = 1; i < kKnots; ++i)
      filter.cdf_[i] = filter.cdf_[i - 1] + 0.5 * step * (filter.pdf_[i - 1] + filter.pdf_[i]);
    const double total = filter.cdf_.back();
    for (std::size_t i = 0; i < kKnots; ++i) {
      filter.pdf_[i] /= total;
      filter.cdf_[i] /= total;
    }
  } else {
    return usage_error(fmt::format("unknown filter '{}'", name))
        .with_field("filter")
        .with_mend("there is box, tent, gaussian");
  }
  for (const auto& [key, value] : settings)
    if (key != known)
      return usage_error(fmt::format("the {} filter has no setting '{}'", name, key))
          .with_field("filter")
          .with_mend(fmt::format("it has {}", known));
  return filter;
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
  }
  return 0;
}

double PixelFilter::pdf_1d(double x) const {
  if (kind_ != Kind::gaussian) return eval_1d(x);
  if (std::fabs(x) > radius_) return 0;
  const double place = (x + radius_) / (2 * radius_) * (kKnots - 1);
  const auto i = std::min(static_cast<std::size_t>(place), std::size_t{kKnots - 2});
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
    case Kind::gaussian: {
      const auto upper = std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, static_cast<double>(u));
      const auto i = static_cast<std::size_t>(upper - cdf_.begin()) - 1;
      // Within a cell the density is linear: solve the quadratic for the cumulative, in the form that does
      // not cancel.
      const double step = 2 * radius_ / (kKnots - 1);
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

}  // namespace candela::render
