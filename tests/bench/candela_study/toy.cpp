#include "tests/bench/candela_study/toy.h"

#include <cmath>
#include <numbers>

#include "common/rng/stream.h"

namespace candela::study {
namespace {

using std::numbers::pi;

// Share of the disc of this radius that lies beyond a line at this distance from the center.
double share_beyond(double distance, double radius) {
  if (radius <= distance) return 0;
  const double c = distance / radius;
  return (std::acos(c) - c * std::sqrt(1 - c * c)) / pi;
}

// [Knuth 1997], the product of uniform numbers; the mean is below 50 here.
std::uint64_t poisson(rng::Stream& stream, double mean) {
  const double limit = std::exp(-mean);
  std::uint64_t count = 0;
  for (double product = stream.next_double(); product > limit; product *= stream.next_double()) ++count;
  return count;
}

// exp(N(-1/2, 1)): mean 1.
double lognormal(rng::Stream& stream) {
  const double u = 1 - stream.next_double(), v = stream.next_double();
  return std::exp(std::sqrt(-2 * std::log(u)) * std::cos(2 * pi * v) - 0.5);
}

}  // namespace

double variance_factor(double alpha, double iterations) {
  const double ratio = std::exp(std::lgamma(iterations + 2) - std::lgamma(iterations + alpha));
  return std::tgamma(1 + alpha) / ((2 - alpha) * iterations * iterations) * (ratio - 1 / std::tgamma(alpha));
}

double bias_factor(double alpha, double iterations) {
  const double ratio = std::exp(std::lgamma(iterations + 1 + alpha) - std::lgamma(iterations + 1));
  return (ratio / std::tgamma(1 + alpha) - 1) / (alpha * iterations);
}

const std::vector<ToyField>& toy_fields() {
  static const std::vector<ToyField> fields = {
      {"const", 1, 1, [](double, double) { return 1.0; }, [](double) { return 1.0; }},
      {"ramp", 1, 1.8, [](double x, double) { return 1 + 1.6 * x; }, [](double) { return 1.0; }},
      {"quad", 1, 1.5, [](double x, double y) { return 1 + 2 * (x * x + y * y); },
       [](double radius) { return 1 + radius * radius; }},
      {"step", 1.8, 1.8, [](double x, double) { return x < 0.1 ? 1.8 : 0.2; },
       [](double radius) { return 1.8 - 1.6 * share_beyond(0.1, radius); }},
      {"dip", 0.2, 1, [](double x, double y) { return x * x + y * y < 0.05 * 0.05 ? 0.2 : 1.0; },
       [](double radius) { return 1 - 0.8 * std::min(1.0, 0.05 * 0.05 / (radius * radius)); }},
  };
  return fields;
}

std::vector<ToyError> toy_exact(const ToyField& field, double alpha,
                                const std::vector<std::uint64_t>& counts) {
  SquaredRadii radii(alpha);
  std::vector<ToyError> errors;
  double means = 0, variances = 0;
  std::uint64_t done = 0;
  for (const std::uint64_t count : counts) {
    for (; done < count; ++done) {
      const double squared = kToyFirstRadius * kToyFirstRadius * radii.next();
      const double mean = field.disc_mean(std::sqrt(squared));
      means += mean;
      variances += std::numbers::e * mean / (kToyDensity * pi * squared);
    }
    const auto n = static_cast<double>(count);
    errors.push_back({means / n - field.truth, variances / (n * n)});
  }
  return errors;
}

std::vector<double> toy_simulated(const ToyField& field, double alpha,
                                  const std::vector<std::uint64_t>& counts, std::uint64_t seed) {
  SquaredRadii radii(alpha);
  rng::Stream stream(rng::key(seed, 0x746f79));
  std::vector<double> means;
  double sum = 0;
  std::uint64_t done = 0;
  for (const std::uint64_t count : counts) {
    for (; done < count; ++done) {
      const double squared = kToyFirstRadius * kToyFirstRadius * radii.next();
      const double area = pi * squared;
      // Photons of the field's highest density, thinned to the field.
      double found = 0;
      for (std::uint64_t k = poisson(stream, kToyDensity * field.ceiling * area); k > 0; --k) {
        const double r = std::sqrt(squared * stream.next_double()), angle = 2 * pi * stream.next_double();
        const double keep = stream.next_double() * field.ceiling;
        if (keep < field.value(r * std::cos(angle), r * std::sin(angle))) found += lognormal(stream);
      }
      sum += found / (kToyDensity * area);
    }
    means.push_back(sum / static_cast<double>(count));
  }
  return means;
}

}  // namespace candela::study
