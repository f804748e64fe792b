// The toy of the adaptive kernels: many pixels, each with one gather point and Poisson photons around it,
// whose radii follow the rules of the product. All is known but the noise.
//
// A gather point is at the origin; a pass has 25 photons per unit area where the density is 1, with lognormal
// contributions (sigma = 1) of mean 1/25; the first radius is 0.5; the kernel is constant. Fields are
// irradiance around the point, 1 (step: 1.8, dip: 0.2) at it. Carriers: density (photons dense where it is
// bright), weight (uniform photons, contributions follow the field), anti (constant field, tilted density,
// contributions that make up for it).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/adaptive/channels.h"
#include "common/adaptive/levels.h"
#include "common/adaptive/plug_in.h"
#include "common/adaptive/quantile.h"
#include "common/film/layout.h"
#include "common/stages/decision.h"
#include "common/stages/epochs.h"
#include "tests/laplacian_stencil.h"
#include "tests/random_draws.h"

namespace candela::test {

enum class ToyField { constant, ramp, quad, step, dip };
enum class ToyCarrier { density, weight, anti };

struct ToyCase {
  ToyField field = ToyField::constant;
  ToyCarrier carrier = ToyCarrier::density;
  double sigma = 1;  // of the contributions

  static constexpr double kDensity = 25, kFirstRadius = 0.5;
  double irradiance(double x, double y) const {
    switch (field) {
      case ToyField::constant:
        return 1;
      case ToyField::ramp:
        return 1 + 1.6 * x;
      case ToyField::quad:
        return 1 + 2 * (x * x + y * y);
      case ToyField::step:
        return x > -0.1 ? 1.8 : 0.2;
      case ToyField::dip:
        return x * x + y * y < 0.05 * 0.05 ? 0.2 : 1;
    }
    return 0;
  }
  double truth() const { return irradiance(0, 0); }
  // Density of photons, relative to kDensity.
  double density(double x, double y) const {
    return carrier == ToyCarrier::density ? irradiance(x, y) : carrier == ToyCarrier::anti ? 1 + 1.6 * x : 1;
  }
  double max_density(double r) const {
    if (carrier == ToyCarrier::weight) return 1;
    if (carrier == ToyCarrier::anti || field == ToyField::ramp) return 1 + 1.6 * r;
    return field == ToyField::quad ? 1 + 2 * r * r : field == ToyField::step ? 1.8 : 1;
  }
  double mean_contribution(double x, double y) const { return irradiance(x, y) / (kDensity * density(x, y)); }
};

// As the plan of work of an integrator would say, for tests at level alpha.
struct ToyPlan {
  EpochPlan epochs;
  std::vector<film::AccumulatorSpec> accumulators;
};
inline constexpr int kToyFilmScale = 19;  // of a mean of 1

inline EpochPlan toy_epochs(std::string rule, std::uint64_t first, std::uint32_t growth, std::uint32_t lag) {
  return {first, growth, lag, std::move(rule), {}};
}
inline ToyPlan fppm_plan(EpochPlan epochs, double alpha, double k, std::uint32_t colors = 1) {
  constexpr int n = 12;
  adaptive::put_levels(adaptive::levels_above(k, 0.001, 0.75), epochs.constants);
  epochs.constants["critical"] =
      std::to_string(adaptive::critical_integer(adaptive::chi_squared_quantile(alpha, n - 1) / (n - 1)));
  return {epochs,
          {adaptive::sectors_spec(kToyFilmScale, colors), adaptive::squares_spec(kToyFilmScale, colors)}};
}
inline ToyPlan cppm_plan(EpochPlan epochs, double alpha) {
  const double factor = std::exp2(-1.0 / 6);
  adaptive::put_levels({factor, 100, {}}, epochs.constants);
  const auto critical = [&](int degrees) {
    return std::to_string(adaptive::critical_integer(adaptive::chi_squared_quantile(alpha, degrees)));
  };
  epochs.constants["critical_outer"] = critical(11);
  epochs.constants["critical_inner"] = critical(5);
  epochs.constants["first_batch"] = "10";
  epochs.constants["batch_growth"] = std::to_string(std::lround(std::exp2(2.0 / 3) * 65536));
  return {epochs, {adaptive::counts_spec()}};
}
inline ToyPlan appm_plan(EpochPlan epochs, bool reference = false) {
  adaptive::put_levels({std::exp2(-1.0 / 16), 255, {}}, epochs.constants);
  epochs.constants["c6"] =
      adaptive::constant_text(adaptive::plug_in_constant(0.25, 1 / 3.14159265358979323846));
  epochs.constants["r_min"] = "0.001";
  epochs.constants["r_max"] = "4";
  ToyPlan plan{epochs, {adaptive::moments_spec(kToyFilmScale), adaptive::laplacian_spec(kToyFilmScale)}};
  if (reference) {
    plan.epochs.constants["pilot_c10"] = adaptive::constant_text(adaptive::reference_constant(0.25, 2.84615));
    plan.accumulators.push_back(adaptive::means_spec(kToyFilmScale));
  }
  return plan;
}

// After some iterations. Errors are one standard error over pixels.
struct ToyOutcome {
  double mse = 0, mse_error = 0;
  double bias = 0, bias_error = 0;
  double radius = 0, log_radius_error = 0;  // geometric mean
  double share_shrunk = 0;                  // of pixels above level 0
  double levels = 0;                        // mean
};

class AdaptiveToy {
 public:
  AdaptiveToy(const ToyCase& problem, ToyPlan plan, std::uint32_t pixels, std::uint64_t seed)
      : problem_(problem), plan_(std::move(plan)), pixels_(pixels), totals_(pixels), draws_(seed) {
    const auto levels = adaptive::get_levels(plan_.epochs.constants);
    if (!levels.ok()) throw std::runtime_error(levels.error().to_string());
    radii_ = levels->radii(ToyCase::kFirstRadius);
    carry_ = empty_carry(plan_.accumulators, pixels_, 1);
    for (const film::AccumulatorSpec& spec : plan_.accumulators)
      units_per_value_.push_back(std::ldexp(1.0, spec.scale_log2));
  }

  // Runs on until so many iterations are done. A last epoch may stay open.
  void run(std::uint64_t iterations) {
    const Epochs epochs(plan_.epochs.first, plan_.epochs.growth);
    while (done_ < iterations) {
      const std::uint64_t epoch = epochs.of_iteration(done_);
      while (states_.size() <= epoch) decide_next();
      const std::uint64_t end = std::min(iterations, epochs.begin(epoch + 1));
      for (std::uint32_t pixel = 0; pixel < pixels_; ++pixel)
        render(pixel, end - done_, epochs.begin(epoch), states_[epoch]);
      done_ = end;
    }
  }

  ToyOutcome outcome() const {
    ToyOutcome out;
    double e2 = 0, e4 = 0, e1 = 0, r1 = 0, r2 = 0;
    const auto n = static_cast<double>(pixels_);
    for (std::uint32_t p = 0; p < pixels_; ++p) {
      const double error = totals_[p] / static_cast<double>(done_) - problem_.truth();
      e1 += error / n;
      e2 += error * error / n;
      e4 += error * error * error * error / n;
      const int g = level(states_.back(), p);
      const double log_radius = std::log(radii_[static_cast<std::size_t>(g)]);
      r1 += log_radius / n;
      r2 += log_radius * log_radius / n;
      out.share_shrunk += (g > 0 ? 1 : 0) / n;
      out.levels += g / n;
    }
    out.mse = e2;
    out.mse_error = std::sqrt(std::max(0.0, e4 - e2 * e2) / n);
    out.bias = e1;
    out.bias_error = std::sqrt(std::max(0.0, e2 - e1 * e1) / n);
    out.radius = std::exp(r1);
    out.log_radius_error = std::sqrt(std::max(0.0, r2 - r1 * r1) / n);
    return out;
  }
  const std::vector<std::string>& states() const { return states_; }
  const Carry& carry() const { return carry_; }

 private:
  static int level(const std::string& state, std::uint32_t pixel) {
    return static_cast<unsigned char>(state[pixel]);
  }

  void decide_next() {
    const std::uint64_t epoch = states_.size();
    DecisionInput input{plan_.epochs, epoch, pixels_, 1, {}, {}};
    if (epoch > 0) input.previous = states_.back();
    if (epoch > plan_.epochs.lag) {
      input.folded = {epoch - 1 - plan_.epochs.lag, states_[epoch - 1 - plan_.epochs.lag], {}};
      for (const auto& sums : open_.front()) input.folded->sums.push_back(&sums);
    }
    auto state = decide(input, carry_);
    if (!state.ok()) throw std::runtime_error(state.error().to_string());
    if (input.folded) open_.erase(open_.begin());
    states_.push_back(std::move(state).value());
    open_.push_back(empty_carry(plan_.accumulators, pixels_, 1).sums);
  }

  // Rounds as accumulators do, with a draw of its own.
  film::Int128 units(std::size_t accumulator, double value) {
    return static_cast<std::int64_t>(std::floor(value * units_per_value_[accumulator] + draws_.uniform()));
  }

  void render(std::uint32_t pixel, std::uint64_t passes, std::uint64_t epoch_begin,
              const std::string& state) {
    constexpr double kPi = 3.14159265358979323846, kR1 = ToyCase::kFirstRadius;
    const bool plug_in = plan_.epochs.rule == "appm", counts = plan_.epochs.rule == "cppm";
    const double r = radii_[static_cast<std::size_t>(level(state, pixel))];
    const bool reference = plug_in && plan_.accumulators.size() == 3;
    const double h = reference ? kR1 * adaptive::pilot_of_level(level(state, pixels_ + pixel))
                     : plug_in ? kR1 * adaptive::pilot_bandwidth(epoch_begin)
                               : 0;
    const double reach = std::max(r, 2 * h);
    const double bound = problem_.max_density(reach);
    const std::uint64_t photons =
        draws_.poisson(static_cast<double>(passes) * ToyCase::kDensity * bound * kPi * reach * reach);
    std::vector<film::Int128> sums(plan_.accumulators[0].channels);
    film::Int128 squares = 0, laplacian = 0, mean = 0;
    for (std::uint64_t i = 0; i < photons; ++i) {
      const double rho = reach * std::sqrt(draws_.uniform()), angle = 2 * kPi * draws_.uniform();
      const double x = rho * std::cos(angle), y = rho * std::sin(angle);
      const double density = problem_.density(x, y);
      if (density != bound && draws_.uniform() * bound >= density) continue;
      const double value = problem_.mean_contribution(x, y) * draws_.lognormal(problem_.sigma);
      const double phi = value / (kPi * kR1 * kR1);
      const bool inside = rho < r;
      if (inside) totals_[pixel] += value / (kPi * r * r);
      if (plug_in) {
        if (inside) squares += units(0, phi * phi * kR1 * kR1 / (r * r));
        if (inside && reference) mean += units(2, phi * kR1 * kR1 / (r * r));
        const int stencil = adaptive::laplacian_stencil(x, y, h);
        if (stencil != 0) laplacian += units(1, phi * stencil * kR1 * kR1 * kR1 * kR1 / (h * h * h * h));
        continue;
      }
      const auto channel = static_cast<std::size_t>(adaptive::disc_channel_of(x, y, r * r));
      sums[channel] += counts ? 1 : units(0, phi);
      if (!counts) squares += units(1, phi * phi);
    }
    std::vector<film::MergedAccumulator>& open = open_.back();
    const auto add = [pixel](film::MergedAccumulator& to, std::span<film::Int128> values) {
      std::vector<film::Int128> present(values.size());
      to.get_pixel(pixel, 0, present);
      for (std::size_t i = 0; i < values.size(); ++i) present[i] += values[i];
      to.set_pixel(pixel, 0, present);
    };
    if (plug_in) {
      add(open[0], {&squares, 1});
      add(open[1], {&laplacian, 1});
      if (reference) add(open[2], {&mean, 1});
    } else {
      add(open[0], sums);
      if (!counts) add(open[1], {&squares, 1});
    }
  }

  ToyCase problem_;
  ToyPlan plan_;
  std::uint32_t pixels_;
  std::vector<double> totals_;  // sums of estimates
  Draws draws_;
  std::vector<double> radii_, units_per_value_;
  std::uint64_t done_ = 0;
  std::vector<std::string> states_;
  Carry carry_;
  std::vector<std::vector<film::MergedAccumulator>> open_;  // of the epochs that are not folded, in order
};

}  // namespace candela::test
