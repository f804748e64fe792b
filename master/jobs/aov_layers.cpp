#include "master/jobs/aov_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/job/aov.h"

namespace candela::master {
namespace {

using film::Int128;
using film::MergedAccumulator;
using Which = film::MergedFilm::Which;

// An accumulator of the halves that count. Null: no such half, or nothing merged.
using Halves = std::array<const MergedAccumulator*, 2>;

Halves find(const JobRow& row, const JobFilm::Snapshot& snapshot, Which which, std::string_view name) {
  Halves halves = {};
  for (std::size_t i = 0; i < row.accumulators.size() && i < snapshot.accumulators.size(); ++i) {
    if (row.accumulators[i].name != name) continue;
    if (which != Which::half1) halves[0] = snapshot.accumulators[i][0].get();
    if (which != Which::half0) halves[1] = snapshot.accumulators[i][1].get();
  }
  return halves;
}

// The sums of a pixel over the halves, in units of the accumulator.
void add_pixel(const Halves& halves, std::uint32_t x, std::uint32_t y, std::span<Int128> sums) {
  std::fill(sums.begin(), sums.end(), Int128{0});
  std::array<Int128, 3> half{};
  for (const MergedAccumulator* accumulator : halves) {
    if (accumulator == nullptr) continue;
    accumulator->get_pixel(x, y, std::span(half).first(sums.size()));
    for (std::size_t c = 0; c < sums.size(); ++c) sums[c] += half[c];
  }
}

}  // namespace

Result<std::vector<image::Layer>> aov_layers(const JobRow& row, const JobFilm::Snapshot& snapshot,
                                             Which which) {
  std::vector<image::Layer> layers;
  CANDELA_ASSIGN(const std::vector<Aov> aovs, parse_aovs(row.settings.aovs));
  double iterations = 0;
  if (which != Which::half1) iterations += static_cast<double>(snapshot.film->merged(0).count());
  if (which != Which::half0) iterations += static_cast<double>(snapshot.film->merged(1).count());
  const bool counted = row.chains.has_value();
  const Halves samples = find(row, snapshot, which, kAovSamples);
  for (const Aov& aov : aovs) {
    const auto spec = std::find_if(row.accumulators.begin(), row.accumulators.end(),
                                   [&](const auto& s) { return s.name == accumulator_name(aov); });
    const std::string_view letters = channel_letters(aov.kind);
    if (spec == row.accumulators.end() || spec->channels != letters.size())
      return internal_error("the job has no sums of its AOV '" + aov.name + "'");
    const Halves halves = find(row, snapshot, which, spec->name);
    const double value_per_unit = std::ldexp(1.0, -spec->scale_log2);
    image::Layer layer{aov.name, {}, {}, letters};
    layer.row = [=, width = row.settings.width](std::uint32_t y, std::span<float> out) {
      std::array<Int128, 3> sums{};
      const std::span<Int128> pixel = std::span(sums).first(letters.size());
      for (std::uint32_t x = 0; x < width; ++x) {
        double divisor = iterations;
        if (counted) {
          add_pixel(samples, x, y, std::span(sums).first(1));
          divisor = static_cast<double>(sums[0]);
        }
        add_pixel(halves, x, y, pixel);
        for (std::size_t c = 0; c < pixel.size(); ++c)
          out[x * pixel.size() + c] =
              divisor > 0 ? static_cast<float>(static_cast<double>(pixel[c]) / divisor * value_per_unit)
                          : 0.0F;
      }
    };
    layers.push_back(std::move(layer));
  }
  return layers;
}

}  // namespace candela::master
