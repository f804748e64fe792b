#include "worker/transport/path/full_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "worker/core/math.h"

namespace candela::transport::path {

void Scaled::normalize_rare() {
  if (mantissa_ == 0 || !std::isfinite(mantissa_)) return;
  int exponent = 0;
  mantissa_ = 2 * std::frexp(mantissa_, &exponent);
  exponent_ += exponent - 1;
}

bool operator<(const Scaled& a, const Scaled& b) {
  if (a.is_zero() || b.is_zero()) return a.mantissa_ < b.mantissa_;
  return a.exponent_ != b.exponent_ ? a.exponent_ < b.exponent_ : a.mantissa_ < b.mantissa_;
}

Scaled& Scaled::operator+=(const Scaled& other) {
  if (other.is_zero()) return *this;
  if (is_zero()) return *this = other;
  const Scaled &large = exponent_ < other.exponent_ ? other : *this,
               &small = exponent_ < other.exponent_ ? *this : other;
  constexpr std::int64_t kFarApart = 64;  // beyond the last bit
  const std::int64_t apart = large.exponent_ - small.exponent_, exponent = large.exponent_;
  double sum = large.mantissa_;
  if (apart < kFarApart)
    sum +=
        small.mantissa_ * std::bit_cast<double>(static_cast<std::uint64_t>(kBias - apart) << kFractionBits);
  mantissa_ = sum;
  exponent_ = exponent;
  normalize();
  return *this;
}

double Scaled::log() const {
  return math::log(mantissa_) + static_cast<double>(exponent_) * std::numbers::ln2;
}

double Scaled::value() const {
  if (holds())
    return mantissa_ * std::bit_cast<double>(static_cast<std::uint64_t>(exponent_ + kBias) << kFractionBits);
  return std::ldexp(mantissa_, static_cast<int>(std::clamp<std::int64_t>(exponent_, -5000, 5000)));
}

double PathNumbers::light_density(std::size_t i) const {
  if (i == 0) return light_prob;
  const double seen = i == edges ? 1 : survival[i - 1];  // hit_lens: by convention
  return pdf_to_eye[i - 1] * seen * factor_to_light[i] / distance_squared[i - 1];
}

double PathNumbers::eye_density(std::size_t i) const {
  if (i == edges) return lens_prob;
  return pdf_to_light[i + 1] * survival[i] * factor_to_eye[i] / distance_squared[i];
}

}  // namespace candela::transport::path
