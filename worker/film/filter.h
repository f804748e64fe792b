// Reconstruction filters by importance sampling: the offset of an eye sample from its pixel's center is drawn
// in proportion to the filter, so that a film is a plain sum of samples (design: film samples use filter
// importance sampling).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "worker/core/vec.h"

namespace candela::film {

// A separable filter f(x) f(y), normalized to integrate to one.
class PixelFilter {
 public:
  // name: box, tent, gaussian, mitchell, catmullrom, lanczos as Mitsuba defines them. Settings: radius (box:
  // 0.5, tent: 1), stddev (gaussian: 0.5), B and C (mitchell: 1/3), lobes (lanczos: 3).
  static Result<PixelFilter> create(const std::string& name, const SettingsMap& settings);

  // An offset in pixels and the sample's weight f / pdf. The density follows |f|: the weight is exactly 1 for
  // box and tent, within 1e-4 of 1 for gaussian, whose density is tabulated; where the filter has negative
  // lobes, +-(integral of |f|)^2 nearly everywhere, never far above, and its mean is 1 [Ernst 2006].
  Vec2 sample(Vec2 u, float& weight) const;
  // The normalized filter at an offset in pixels from the pixel's center to a film position: what a light
  // path's splat at that position adds to the pixel. Of a box each position belongs to as many pixels as its
  // neighbors: the lower edge counts, the upper one does not.
  float eval(float dx, float dy) const {
    if (kind_ == Kind::box) {
      const auto r = static_cast<float>(radius_);
      if (!(dx >= -r && dx < r && dy >= -r && dy < r)) return 0;
    }
    return static_cast<float>(eval_1d(static_cast<double>(dx)) * eval_1d(static_cast<double>(dy)));
  }
  // Value of the normalized 1D filter, and of its sampling density, at an offset in pixels.
  double eval_1d(double x) const;
  double pdf_1d(double x) const;
  double radius() const { return radius_; }
  bool has_negative_lobes() const { return negative_lobes_; }

 private:
  enum class Kind : std::uint8_t { box, tent, gaussian, cubic, lanczos };
  PixelFilter() = default;
  void tabulate(std::size_t knots);
  std::size_t cell(double u) const;
  float sample_1d(float u, float& weight) const;

  Kind kind_ = Kind::box;
  double radius_ = 0.5;
  double exponent_ = 0;  // gaussian: -1 / (2 stddev^2)
  double edge_ = 0;      // gaussian: its value at the radius, subtracted so that it ends at zero
  double inner_[4] = {}, outer_[4] = {};  // cubic: polynomials of |x| below 1, and below 2
  double norm_ = 1;                       // 1 / integral
  bool negative_lobes_ = false;
  std::vector<double> pdf_;  // all but box and tent: density at the knots, linear between them
  std::vector<double> cdf_;
  std::vector<std::uint16_t> guide_;  // cell(k / size) for each k
};

}  // namespace candela::film
