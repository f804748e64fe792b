#include "worker/integrators/pilot/trials.h"

#include <algorithm>

namespace candela::integrators::pilot {
namespace {

constexpr int kRounds = 3;            // of weighting trials by their errors
constexpr double kMeanShare = 0.01;   // of the mean's square, in denominators
constexpr double kMinError = 1e-12;   // what noise may make negative
constexpr double kMaxValueError = 1;  // of one value's squared error: outliers say nothing in a small pilot

}  // namespace

std::vector<float> means_of_squares(std::span<const float> image, std::uint32_t width, std::uint32_t height) {
  const std::uint32_t side = std::clamp(std::min(width, height) / kMinSquares, 1U, kSquare);
  std::vector<float> means;
  for (std::uint32_t top = 0; top < height; top += side)
    for (std::uint32_t left = 0; left < width; left += side) {
      const std::uint32_t bottom = std::min(top + side, height), right = std::min(left + side, width);
      double sum[3] = {};
      for (std::uint32_t y = top; y < bottom; ++y)
        for (std::uint32_t x = left; x < right; ++x)
          for (std::size_t c = 0; c < 3; ++c)
            sum[c] += static_cast<double>(image[3 * (std::size_t{y} * width + x) + c]);
      const auto pixels = static_cast<double>((bottom - top) * (right - left));
      for (const double of_channel : sum) means.push_back(static_cast<float>(of_channel / pixels));
    }
  return means;
}

std::vector<double> trial_errors(std::span<const Trial> trials) {
  const std::size_t values = trials.empty() ? 0 : trials[0].images[0].size();
  std::vector<double> errors(trials.size(), 1.0), truth(values * kReplicates);
  if (values == 0) return errors;
  for (int round = 0; round < kRounds; ++round) {
    double weights = 0;
    for (const double error : errors) weights += 1 / error;
    std::fill(truth.begin(), truth.end(), 0.0);
    for (std::size_t t = 0; t < trials.size(); ++t)
      for (std::size_t r = 0; r < kReplicates; ++r)
        for (std::size_t i = 0; i < values; ++i)
          truth[r * values + i] += static_cast<double>(trials[t].images[r][i]) / (errors[t] * weights);
    double mean = 0;
    for (const double value : truth) mean += value / static_cast<double>(truth.size());
    if (!(mean > 0)) return errors;
    for (std::size_t t = 0; t < trials.size(); ++t) {
      double sum = 0;
      for (std::size_t i = 0; i < values; ++i) {
        double whole = 0;
        for (std::size_t r = 0; r < kReplicates; ++r) whole += truth[r * values + i] / kReplicates;
        for (std::size_t r = 0; r < kReplicates; ++r) {
          const auto value = static_cast<double>(trials[t].images[r][i]);
          const double square = (value - truth[(r + 1) % kReplicates * values + i]) *
                                (value - truth[(r + 2) % kReplicates * values + i]);
          sum += std::clamp(square / (whole * whole + kMeanShare * mean * mean), -kMaxValueError,
                            kMaxValueError);
        }
      }
      errors[t] = std::max(sum / static_cast<double>(values * kReplicates), kMinError);
    }
  }
  return errors;
}

Choice choose(std::span<const Trial> trials) {
  Choice choice;
  choice.inefficiency = trial_errors(trials);
  for (std::size_t t = 0; t < trials.size(); ++t) choice.inefficiency[t] *= trials[t].cost;
  const double best = *std::min_element(choice.inefficiency.begin(), choice.inefficiency.end());
  for (std::size_t t = 0; t < trials.size(); ++t) {
    double& value = choice.inefficiency[t];
    choice.cost.push_back(trials.front().cost > 0 ? trials[t].cost / trials.front().cost : 1);
    value = best > 0 ? value / best : 1;
    if (value <= (choice.cost[t] <= kCheap ? kAlike : 1)) choice.index = t;
  }
  return choice;
}

bool last_is_better(std::span<const Trial> trials, std::size_t chosen) {
  const std::vector<double> errors = trial_errors(trials);
  return errors.back() * trials.back().cost < errors[chosen] * trials[chosen].cost;
}

}  // namespace candela::integrators::pilot
