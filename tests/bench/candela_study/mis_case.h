// Integrals with several sampling techniques whose variances are known by quadrature: D1 to D8 and L1 of
// tests/mis_problems.h, and R1 to R6, a lamp over a point (mis_rectangle.h).
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "common/mis/estimators.h"
#include "common/rng/stream.h"

namespace candela::test {
struct MisProblem;
}

namespace candela::study {

// A node of a quadrature: the integrand and the densities there, in one measure. Techniques that fail have
// densities that integrate to less than 1.
struct MisPoint {
  double weight = 0, f = 0;
  mis::Vector p{};
};

// The part of a sample that estimators see.
struct MisSample {
  mis::Vector c{};
  double f_over_q = 0;
};

struct MisCase {
  std::string name;  // "D1", "R2 spherical+parallel"
  mis::Allocation allocation;
  std::vector<MisPoint> points;
  // Appends the samples of one batch.
  std::function<void(rng::Stream&, std::vector<MisSample>&)> draw;
  // Points at which weights are drawn, and the axis: one row, or a square picture of rows.
  std::vector<MisPoint> shown;
  std::uint32_t shown_width = 0;
};

// The sample of technique `drawn` at a point.
MisSample sample_at(const mis::Allocation& allocation, const MisPoint& point);

std::vector<MisCase> mis_cases();
MisCase line_case(const test::MisProblem& problem);  // D1 to D8
// Light selections among six lights, of "uniform", "power" and "unshadowed".
MisCase lights_case(const std::vector<std::string>& selections);

// ---- exact values of one batch

struct MisExact {
  mis::Sums sums;       // expectations: A, b in color 0
  mis::Vector alpha{};  // solves A alpha = b; sums to the integral
  double integral = 0;
  std::size_t best = 0;  // the technique of least variance among those that cover the integrand
};
MisExact exact_of(const MisCase& problem);

// "balance", "power", "cutoff", "maximum", "best", "best, all samples", "optimal".
inline constexpr std::array<const char*, 7> kMisStrategies = {
    "balance", "power", "cutoff", "maximum", "best", "best, all samples", "optimal"};
double exact_variance(const MisCase& problem, const MisExact& exact, const std::string& strategy);
// The weights of all techniques at a point. Precondition: f > 0 there. The strategy `best, all samples` has
// the weights of `best`.
mis::Vector weights_at(const MisCase& problem, const MisExact& exact, const std::string& strategy,
                       const MisPoint& point);

}  // namespace candela::study
