// Reconstruction filters by importance sampling: the offset of an eye sample from its pixel's centre is drawn
// in proportion to the filter, so that a film is a plain sum of samples (design: film samples use filter
// importance sampling).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "worker/core/vec.h"

namespace candela::render {

// A separable filter f(x) f(y), normalised to integrate to one.
class PixelFilter {
 public:
  // name: box, tent, gaussian as Mitsuba defines them. Settings: radius (box: 0.5, tent: 1), stddev
  // (gaussian: 0.5).
  static Result<PixelFilter> create(const std::string& name, const SettingsMap& settings);

  // An offset in pixels and the sample's weight f / pdf: exactly 1 for box and tent, within 1e-4 of 1 for
  // gaussian, whose density is tabulated.
  Vec2 sample(Vec2 u, float& weight) const;
  // Value of the normalised 1D filter, and of its sampling density, at an offset in pixels.
  double eval_1d(double x) const;
  double pdf_1d(double x) const;
  double radius() const { return radius_; }
  bool has_negative_lobes() const { return false; }

 private:
  enum class Kind : std::uint8_t { box, tent, gaussian };
  PixelFilter() = default;
  float sample_1d(float u, float& weight) const;

  Kind kind_ = Kind::box;
  double radius_ = 0.5;
  double exponent_ = 0;      // gaussian: -1 / (2 stddev^2)
  double edge_ = 0;          // gaussian: its value at the radius, subtracted so that it ends at zero
  double norm_ = 1;          // 1 / integral
  std::vector<double> pdf_;  // gaussian: density at the knots, linear between them
  std::vector<double> cdf_;
};

}  // namespace candela::render
