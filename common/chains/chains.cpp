#include "common/chains/chains.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "common/film/codec.h"
#include "common/rng/stream.h"

namespace candela::chains {
namespace {

constexpr std::uint32_t kMagic = 0x31484343;  // "CCH1"

// Mean of values with sum and sum of squares, and the standard error of that mean.
Normalisation from_sums(double sum, double square_sum, std::uint64_t samples) {
  Normalisation result;
  result.samples = samples;
  if (samples == 0) return result;
  const auto n = static_cast<double>(samples);
  result.b = sum / n;
  // Contributions of hard scenes are nearly all zero and a few enormous: the two terms differ widely, and the
  // subtraction loses nothing that matters.
  const double variance = std::max(0.0, square_sum / n - result.b * result.b);
  result.standard_error = samples > 1 ? std::sqrt(variance / (n - 1)) : result.b;
  return result;
}

void put_f64(std::string& out, double value) {
  film::put_u64(out, std::bit_cast<std::uint64_t>(value));
}

}  // namespace

std::string encode(const ChainRecord& record) {
  const ChainCounts& c = record.counts;
  std::string out;
  film::put_u32(out, kMagic);
  for (const std::uint64_t value : {record.segments, c.mutations, c.accepted, c.large_steps, c.large_accepted,
                                    c.longest_stay, c.present_stay})
    film::put_u64(out, value);
  put_f64(out, c.large_sum);
  put_f64(out, c.large_square_sum);
  film::put_u32(out, std::bit_cast<std::uint32_t>(c.stay_x));
  film::put_u32(out, std::bit_cast<std::uint32_t>(c.stay_y));
  film::put_u32(out, static_cast<std::uint32_t>(record.state.size()));
  out += record.state;
  return out;
}

Result<ChainRecord> decode(std::string_view bytes) {
  const auto bad = [](std::string_view what) {
    return input_error(fmt::format("a chain's record cannot be used: {}", what)).with_field("chain_records");
  };
  film::Reader reader(bytes);
  if (reader.u32() != kMagic) return bad("it does not start as one");
  ChainRecord record;
  ChainCounts& c = record.counts;
  for (std::uint64_t* value : {&record.segments, &c.mutations, &c.accepted, &c.large_steps, &c.large_accepted,
                               &c.longest_stay, &c.present_stay})
    *value = reader.u64();
  c.large_sum = std::bit_cast<double>(reader.u64());
  c.large_square_sum = std::bit_cast<double>(reader.u64());
  c.stay_x = std::bit_cast<float>(reader.u32());
  c.stay_y = std::bit_cast<float>(reader.u32());
  const std::uint32_t length = reader.u32();
  if (!reader.ok() || reader.rest().size() != length) return bad("its length is wrong");
  if (length > kMaxStateBytes) return bad(fmt::format("its state has more than {} bytes", kMaxStateBytes));
  if (c.accepted > c.mutations || c.large_steps > c.mutations || c.large_accepted > c.large_steps ||
      c.large_accepted > c.accepted || c.longest_stay > c.mutations || c.present_stay > c.longest_stay)
    return bad("its counts contradict each other");
  const auto sum_ok = [](double value) { return std::isfinite(value) && value >= 0; };
  if (!sum_ok(c.large_sum) || !sum_ok(c.large_square_sum) || !std::isfinite(c.stay_x) ||
      !std::isfinite(c.stay_y))
    return bad("a number of it is negative or not finite");
  record.state = std::string(reader.rest());
  return record;
}

BootstrapTable::BootstrapTable(std::uint64_t samples) : values_(samples) {}

Result<void> BootstrapTable::insert(std::uint64_t begin, std::span<const float> values) {
  if (begin > values_.size() || values.size() > values_.size() - begin)
    return input_error(fmt::format("bootstrap samples from {} on, {} of them, lie beyond the {} there are",
                                   begin, values.size(), values_.size()))
        .with_field("contributions");
  for (const float value : values)
    if (!std::isfinite(value) || value < 0)
      return input_error("a bootstrap sample is negative or not finite").with_field("contributions");
  if (!known_.insert(begin, begin + values.size()))
    return refused_error(fmt::format("bootstrap samples from {} on are known already", begin))
        .with_field("contributions");
  std::copy(values.begin(), values.end(), values_.begin() + static_cast<std::ptrdiff_t>(begin));
  return {};
}

namespace {

std::pair<double, double> sums_of(std::span<const float> values) {
  double sum = 0, square_sum = 0;
  for (const float value : values) {
    sum += static_cast<double>(value);
    square_sum += static_cast<double>(value) * static_cast<double>(value);
  }
  return {sum, square_sum};
}

}  // namespace

Normalisation BootstrapTable::normalisation() const {
  const auto [sum, square_sum] = sums_of(values_);
  return from_sums(sum, square_sum, values_.size());
}

std::vector<std::uint64_t> BootstrapTable::choose_starts(std::uint32_t chains, std::uint64_t seed) const {
  const double sum = sums_of(values_).first;
  std::vector<std::uint64_t> starts;
  if (!(sum > 0)) return starts;
  starts.reserve(chains);
  rng::Stream stream(rng::key(seed, 0x636f6d62ULL));  // "comb"
  const double offset = stream.next_double();
  double below = 0;
  std::uint64_t last = 0;  // with a contribution
  for (std::uint64_t i = 0; i < values_.size() && starts.size() < chains; ++i) {
    if (values_[i] > 0) last = i;
    below += static_cast<double>(values_[i]);
    while (starts.size() < chains && (static_cast<double>(starts.size()) + offset) / chains * sum < below)
      starts.push_back(i);
  }
  starts.resize(chains, last);  // a last tooth that rounding put at the very end
  for (std::size_t i = starts.size(); i > 1; --i) {
    const auto j = static_cast<std::size_t>(stream.next_double() * static_cast<double>(i));
    std::swap(starts[i - 1], starts[j]);
  }
  return starts;
}

int film_scale_log2(double b0, int pilot_scale_log2) {
  return b0 > 0 ? film::scale_log2_for(b0) : pilot_scale_log2;
}

Normalisation pool(const BootstrapTable& bootstrap, std::span<const ChainCounts> counts) {
  auto [sum, square_sum] = sums_of(bootstrap.values());
  std::uint64_t samples = bootstrap.values().size();
  for (const ChainCounts& c : counts) {
    sum += c.large_sum;
    square_sum += c.large_square_sum;
    samples += c.large_steps;
  }
  return from_sums(sum, square_sum, samples);
}

}  // namespace candela::chains
