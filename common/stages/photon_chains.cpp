#include "common/stages/photon_chains.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "common/film/codec.h"

namespace candela::photon_chains {
namespace {

// The place of a count in the accumulator.
struct Place {
  std::uint32_t x, y, channel;
};
Place place(std::uint32_t count, std::uint32_t channels, std::uint32_t width) {
  const std::uint32_t pixel = count / channels;
  return {pixel % width, pixel / width, count % channels};
}

// e^x for small x, by + * / alone: the same bits on every machine.
double exponential(double x) {
  const double y = x / 16;
  double sum = 1;
  for (int i = 12; i >= 1; --i) sum = 1 + y / i * sum;
  for (int i = 0; i < 4; ++i) sum *= sum;
  return sum;
}

}  // namespace

film::AccumulatorSpec spec(std::uint32_t width, std::uint32_t height) {
  const std::uint64_t pixels = std::uint64_t{width} * height;
  const std::uint64_t channels = (kCounts + pixels - 1) / pixels;
  return {std::string(kAccumulator), static_cast<std::uint32_t>(channels), 0,
          film::AccumulatorSpec::Per::epoch};
}

void add(const Counts& counts, std::uint64_t key, film::UnitAccumulator& to, std::uint32_t width,
         film::SampleCounts& sample_counts) {
  const std::array<std::uint64_t, kCounts> all = {
      counts.iterations, counts.black_iterations, counts.light_paths,    counts.visible_paths,
      counts.mutations,  counts.accepted,         counts.visible_squares};
  for (std::uint32_t i = 0; i < kCounts; ++i) {
    const Place at = place(i, to.spec().channels, width);
    const auto value = static_cast<double>(all[i]);
    to.add(at.x, at.y, at.channel, std::span(&value, 1), key, sample_counts);
  }
}

Counts read(const film::MergedAccumulator& sums) {
  const auto count = [&](std::uint32_t i) {
    const Place at = place(i, sums.spec().channels, sums.width());
    return static_cast<std::uint64_t>(sums.sum(at.x, at.y, at.channel));
  };
  return {count(0), count(1), count(2), count(3), count(4), count(5), count(6)};
}

double flicker(const Counts& counts) {
  if (counts.iterations < 2 || counts.visible_paths == 0) return 0;
  const auto n = static_cast<double>(counts.iterations), sum = static_cast<double>(counts.visible_paths);
  const double variance = (static_cast<double>(counts.visible_squares) - sum / n * sum) / (n - 1);
  return std::sqrt(std::max(variance, 0.0)) / (sum / n);
}

double next_step(double step, std::uint64_t accepted, std::uint64_t mutations) {
  const double share = static_cast<double>(accepted) / static_cast<double>(mutations);
  return std::clamp(step * exponential(kGain * (share - kAcceptance)), kMinStep, kMaxStep);
}

std::string state_of(double step) {
  std::string state;
  film::put_u64(state, std::bit_cast<std::uint64_t>(step));
  return state;
}

Result<double> step_of(std::string_view state) {
  film::Reader reader(state);
  const auto step = std::bit_cast<double>(reader.u64());
  if (reader.ok() && reader.rest().empty() && step >= kMinStep && step <= kMaxStep) return step;
  return input_error(fmt::format("the state '{}' of the unit's epoch is not a step size from {} to {}", kRule,
                                 kMinStep, kMaxStep))
      .with_field("states");
}

}  // namespace candela::photon_chains
