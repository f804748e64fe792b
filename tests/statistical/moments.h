// Mean, variance and skewness of numbers seen one by one, by recurrences that lose no digits to a large mean
// [Welford 1962], and of two such sets together [Chan 1983].
//
// Degenerate cases: of no numbers the mean is 0; the variance of fewer than two is not known, and given as 0
// with freedom() 0, which quantiles.h takes for "nothing is known"; skewness without variance is 0.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace candela::statistical {

class Moments {
 public:
  void add(double x) {
    const auto before = static_cast<double>(count_++);
    const auto n = static_cast<double>(count_);
    const double off = x - mean_, step = off / n, squared = off * step * before;
    mean_ += step;
    cubes_ += squared * step * (n - 2) - 3 * step * squares_;
    squares_ += squared;
  }
  // As if all of the other's had been added.
  void merge(const Moments& other) {
    if (other.count_ == 0) return;
    const auto a = static_cast<double>(count_), b = static_cast<double>(other.count_), n = a + b;
    const double off = other.mean_ - mean_;
    cubes_ += other.cubes_ + off * off * off * a * b * (a - b) / (n * n) +
              3 * off * (a * other.squares_ - b * squares_) / n;
    squares_ += other.squares_ + off * off * a * b / n;
    mean_ += off * b / n;
    count_ += other.count_;
  }

  std::uint64_t count() const { return count_; }
  double mean() const { return mean_; }
  // Of one number, without bias, and its degrees of freedom.
  double variance() const { return count_ < 2 ? 0 : squares_ / freedom(); }
  double freedom() const { return count_ < 2 ? 0 : static_cast<double>(count_ - 1); }
  // Of the mean, where the numbers are independent.
  double variance_of_mean() const { return count_ < 2 ? 0 : variance() / static_cast<double>(count_); }
  double error() const { return std::sqrt(variance_of_mean()); }
  // Of the set itself: third moment over the 3/2th power of the second.
  double skewness() const {
    const auto n = static_cast<double>(count_);
    return squares_ > 0 ? std::sqrt(n) * cubes_ / (squares_ * std::sqrt(squares_)) : 0;
  }

 private:
  std::uint64_t count_ = 0;
  double mean_ = 0, squares_ = 0, cubes_ = 0;  // sums of powers of differences from the mean
};

template <class Numbers>
Moments moments_of(const Numbers& numbers) {
  Moments moments;
  for (const auto& x : numbers) moments.add(static_cast<double>(x));
  return moments;
}

// Of images, value by value.
using ImageMoments = std::vector<Moments>;
inline void add_image(ImageMoments& moments, std::span<const float> image) {
  moments.resize(image.size());
  for (std::size_t i = 0; i < image.size(); ++i) moments[i].add(static_cast<double>(image[i]));
}
// Of the mean image as a whole: the mean over its values of variance / (value^2 + 0.01 mean^2), which is the
// relMSE to be expected of it. Values that do not vary add nothing, not even where the image is black.
inline double relative_variance(const ImageMoments& moments) {
  Moments whole;
  for (const Moments& value : moments) whole.add(value.mean());
  double sum = 0;
  for (const Moments& value : moments)
    if (const double variance = value.variance_of_mean(); variance > 0)
      sum += variance / (value.mean() * value.mean() + 0.01 * whole.mean() * whole.mean());
  return sum / static_cast<double>(moments.size());
}

}  // namespace candela::statistical
