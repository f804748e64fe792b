#include "master/jobs/aov_layers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "common/image/cryptomatte.h"
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

// The ids of the pixels of a row with their coverage. Layers of one matte share it: they are read row by row.
class RankedRow {
 public:
  struct Part {
    std::uint32_t id;  // bits of a float
    double coverage;   // above 0
  };
  // `divisor` of a pixel's sums, by x and y.
  RankedRow(const Halves& halves, std::uint32_t width, std::vector<std::uint32_t> ids, double value_per_unit,
            std::function<double(std::uint32_t, std::uint32_t)> divisor)
      : halves_(halves),
        ids_(std::move(ids)),
        value_per_unit_(value_per_unit),
        divisor_(std::move(divisor)),
        pixels_(width) {}

  // By pixel: the largest coverage first, of equal ones the smaller id.
  const std::vector<std::vector<Part>>& read(std::uint32_t y) {
    if (y == row_) return pixels_;
    row_ = y;
    for (std::uint32_t x = 0; x < pixels_.size(); ++x) rank(x, y);
    return pixels_;
  }

 private:
  void rank(std::uint32_t x, std::uint32_t y) {
    std::vector<Part>& parts = pixels_[x];
    parts.clear();
    sums_.clear();
    for (const MergedAccumulator* accumulator : halves_) {
      if (accumulator == nullptr) continue;
      accumulator->keys().get_pixel(x, y, keys_);
      for (const film::KeyedSums::KeySum& key : keys_) add(ids_[key.key], key.sum);
    }
    const double divisor = sums_.empty() ? 0 : divisor_(x, y);
    for (const auto& [id, sum] : sums_)
      if (sum > 0 && divisor > 0) parts.push_back({id, static_cast<double>(sum) / divisor * value_per_unit_});
    std::sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
      return a.coverage != b.coverage ? a.coverage > b.coverage : a.id < b.id;
    });
  }
  // Names of one id are one matte.
  void add(std::uint32_t id, Int128 sum) {
    const auto found =
        std::find_if(sums_.begin(), sums_.end(), [&](const auto& known) { return known.first == id; });
    if (found == sums_.end())
      sums_.emplace_back(id, sum);
    else
      found->second += sum;
  }

  Halves halves_;
  std::vector<std::uint32_t> ids_;  // by key
  double value_per_unit_;
  std::function<double(std::uint32_t, std::uint32_t)> divisor_;
  std::vector<film::KeyedSums::KeySum> keys_;
  std::vector<std::pair<std::uint32_t, Int128>> sums_;
  std::optional<std::uint32_t> row_;  // of pixels_
  std::vector<std::vector<Part>> pixels_;
};

// Four values of a pixel for the ranks 2 * pair and 2 * pair + 1.
void put_ranks(const std::vector<RankedRow::Part>& parts, std::size_t pair, float* out) {
  for (std::size_t i = 0; i < 2; ++i, out += 2) {
    const std::size_t rank = 2 * pair + i;
    out[0] = rank < parts.size() ? std::bit_cast<float>(parts[rank].id) : 0.0F;
    out[1] = rank < parts.size() ? static_cast<float>(parts[rank].coverage) : 0.0F;
  }
}

// A color for people: three bytes of the id, by coverage.
void put_preview(const std::vector<RankedRow::Part>& parts, float* out) {
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0;
    for (const RankedRow::Part& part : parts) sum += part.coverage * (part.id >> 8 * c & 0xff) / 255.0;
    out[c] = static_cast<float>(sum);
  }
}

}  // namespace

void describe_mattes(const JobRow& row, std::map<std::string, std::string>& attributes) {
  const auto aovs = parse_aovs(row.settings.aovs);
  if (!aovs.ok()) return;
  for (const Aov& aov : *aovs)
    for (const film::AccumulatorSpec& spec : row.accumulators)
      if (is_matte(aov.kind) && spec.name == accumulator_name(aov))
        image::add_matte_attributes(aov.name, spec.key_names, attributes);
}

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
    const bool matte = is_matte(aov.kind);
    if (spec == row.accumulators.end() || (!matte && spec->channels != letters.size()) ||
        matte != (spec->domain == film::AccumulatorSpec::Domain::keys))
      return internal_error("the job has no sums of its AOV '" + aov.name + "'");
    const Halves halves = find(row, snapshot, which, spec->name);
    const double value_per_unit = std::ldexp(1.0, -spec->scale_log2);
    const std::uint32_t width = row.settings.width;
    const auto divisor_of = [=](std::uint32_t x, std::uint32_t y) {
      if (!counted) return iterations;
      std::array<Int128, 1> count{};
      add_pixel(samples, x, y, count);
      return static_cast<double>(count[0]);
    };
    if (matte) {
      std::vector<std::uint32_t> ids;
      for (const std::string& name : spec->key_names) ids.push_back(image::matte_id_bits(name));
      const auto row_of =
          std::make_shared<RankedRow>(halves, width, std::move(ids), value_per_unit, divisor_of);
      const std::vector<std::string> names = layer_names(aov);
      layers.push_back({names[0], {}, [=](std::uint32_t y, std::span<float> out) {
                          const auto& pixels = row_of->read(y);
                          for (std::size_t x = 0; x < width; ++x) put_preview(pixels[x], &out[3 * x]);
                        }});
      for (std::size_t pair = 0; pair + 1 < names.size(); ++pair)
        layers.push_back({names[pair + 1],
                          {},
                          [=](std::uint32_t y, std::span<float> out) {
                            const auto& pixels = row_of->read(y);
                            for (std::size_t x = 0; x < width; ++x) put_ranks(pixels[x], pair, &out[4 * x]);
                          },
                          "RGBA"});
      continue;
    }
    image::Layer layer{aov.name, {}, {}, letters};
    layer.row = [=](std::uint32_t y, std::span<float> out) {
      std::array<Int128, 3> sums{};
      const std::span<Int128> pixel = std::span(sums).first(letters.size());
      for (std::uint32_t x = 0; x < width; ++x) {
        const double divisor = divisor_of(x, y);
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
