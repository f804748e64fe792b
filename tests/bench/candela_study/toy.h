// The pixel whose error is known in closed form: one gather point at the origin, photons of a Poisson process
// with 25 photons per unit area and iteration on average, lognormal contributions (sigma = 1) and the
// constant kernel. The photons are dense where the field is bright; all have the same mean contribution.
//
// An iteration of radius r has the mean m(r), the mean of the field over the disc, and the variance
// e m(r) / (25 pi r^2), because E[phi^2] = e E[phi]^2.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace candela::study {

// [Knaus 2011]: r_{i+1}^2 = r_i^2 (i + alpha) / (i + 1), as a factor of r_1^2, for i = 1, 2, ...
class SquaredRadii {
 public:
  explicit SquaredRadii(double alpha) : alpha_(alpha) {}
  double next() {
    if (i_ > 0) factor_ *= (i_ + alpha_) / (i_ + 1);
    i_ += 1;
    return factor_;
  }

 private:
  double alpha_, factor_ = 1, i_ = 0;
};

// Variance of the mean of N iterations over that of the first one, if the variance goes as r^-2; bias of the
// mean over that of the first one, if the bias goes as r^2. Closed forms of the sums, from lgamma.
double variance_factor(double alpha, double iterations);
double bias_factor(double alpha, double iterations);

struct ToyField {
  std::string name;
  double truth;                                     // at the origin
  double ceiling;                                   // no value of the field in the first disc is larger
  std::function<double(double x, double y)> value;  // at a place
  std::function<double(double radius)> disc_mean;   // over the disc about the origin
};
inline constexpr double kToyDensity = 25, kToyFirstRadius = 0.5;
const std::vector<ToyField>& toy_fields();

struct ToyError {
  double bias = 0, variance = 0;
  double mse() const { return bias * bias + variance; }
};
// The error of the mean of so many iterations; `counts` ascend.
std::vector<ToyError> toy_exact(const ToyField& field, double alpha,
                                const std::vector<std::uint64_t>& counts);
// Means of one simulated pixel after so many iterations.
std::vector<double> toy_simulated(const ToyField& field, double alpha,
                                  const std::vector<std::uint64_t>& counts, std::uint64_t seed);

}  // namespace candela::study
