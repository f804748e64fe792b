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

constexpr std::uint32_t kMagic = 0x31484343;               // "CCH1"
constexpr std::uint32_t kMagicWithMutations = 0x32484343;  // "CCH2": counts by mutation behind the state
// "CCH3": behind the state sums of mollified paths, then a number of mutations that may be 0
constexpr std::uint32_t kMagicMollified = 0x33484343;
constexpr std::size_t kMollifiedBytes = 6 * 8;

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

// The mollified part of one large step, and its regular part.
struct MollifiedSums {
  double steps = 0, chains = 0;
  double start_share = 0;
  double mean = 0, variance = 0, regular_mean = 0, regular_variance = 0, covariance = 0;
};
// Nothing: no chain mollifies, or none has a large step. A chain of a record without such sums, which older
// builds made, has regular paths alone.
std::optional<MollifiedSums> mollified_sums(std::span<const ChainCounts> counts) {
  MollifiedSums out;
  double all = 0, all_squares = 0, part = 0, part_squares = 0, products = 0;
  for (const ChainCounts& c : counts) {
    if (c.mutations == 0) continue;
    all += c.large_sum;
    all_squares += c.large_square_sum;
    out.steps += static_cast<double>(c.large_steps);
    if (!c.mollified) continue;
    out.chains += 1;
    out.start_share += c.mollified->start_share;
    part += c.mollified->large_sum;
    part_squares += c.mollified->large_square_sum;
    products += c.mollified->large_product_sum;
  }
  if (out.chains == 0 || out.steps == 0) return std::nullopt;
  out.start_share /= out.chains;
  out.mean = part / out.steps;
  out.regular_mean = (all - part) / out.steps;
  // Regular part: the whole without the other one.
  const auto spread = [&](double square_sum, double product) { return square_sum / out.steps - product; };
  out.variance = std::max(0.0, spread(part_squares, out.mean * out.mean));
  out.regular_variance =
      std::max(0.0, spread(all_squares - 2 * products + part_squares, out.regular_mean * out.regular_mean));
  out.covariance = spread(products - part_squares, out.mean * out.regular_mean);
  return out;
}

void put_f64(std::string& out, double value) {
  film::put_u64(out, std::bit_cast<std::uint64_t>(value));
}

}  // namespace

std::optional<std::size_t> independent_part(std::span<const std::string> layers, std::size_t layer) {
  const auto at = std::ranges::find(layers, layers[layer] + std::string(kIndependentPart));
  if (at == layers.end()) return std::nullopt;
  return static_cast<std::size_t>(at - layers.begin());
}

std::vector<std::string> shown_layers(std::span<const std::string> layers) {
  std::vector<std::string> shown;
  for (const std::string& name : layers)
    if (!name.ends_with(kIndependentPart)) shown.push_back(name);
  return shown;
}

Result<void> validate(const ChainPlan& plan) {
  if (plan.chains < 2 || plan.chains % 2 != 0 || plan.chains > kMaxChains)
    return input_error(
               fmt::format("{} chains are not an even number within 2 and {}", plan.chains, kMaxChains))
        .with_field("chains");
  if (plan.bootstrap_samples == 0 || plan.bootstrap_samples > kMaxBootstrapSamples)
    return input_error(fmt::format("{} bootstrap samples are not within 1 and {}", plan.bootstrap_samples,
                                   kMaxBootstrapSamples))
        .with_field("bootstrap_samples");
  if (plan.segment_mutations == 0 || plan.segment_mutations > kMaxSegmentMutations)
    return input_error(fmt::format("{} mutations a segment are not within 1 and {}", plan.segment_mutations,
                                   kMaxSegmentMutations))
        .with_field("segment_mutations");
  return {};
}

std::string encode(const ChainRecord& record) {
  const ChainCounts& c = record.counts;
  std::string out;
  film::put_u32(out, c.mollified ? kMagicMollified : c.by_mutation.empty() ? kMagic : kMagicWithMutations);
  for (const std::uint64_t value : {record.segments, c.mutations, c.accepted, c.large_steps, c.large_accepted,
                                    c.longest_stay, c.present_stay})
    film::put_u64(out, value);
  put_f64(out, c.large_sum);
  put_f64(out, c.large_square_sum);
  film::put_u32(out, std::bit_cast<std::uint32_t>(c.stay_x));
  film::put_u32(out, std::bit_cast<std::uint32_t>(c.stay_y));
  film::put_u32(out, static_cast<std::uint32_t>(record.state.size()));
  out += record.state;
  if (const auto& m = c.mollified) {
    for (const double value :
         {m->start_share, m->large_sum, m->large_square_sum, m->large_product_sum, m->stay_sum})
      put_f64(out, value);
    film::put_u64(out, m->lost);
  } else if (c.by_mutation.empty()) {
    return out;
  }
  film::put_u8(out, static_cast<std::uint8_t>(c.by_mutation.size()));
  for (const MutationCounts& m : c.by_mutation) {
    film::put_u8(out, static_cast<std::uint8_t>(m.name.size()));
    out += m.name;
    film::put_u64(out, m.proposed);
    film::put_u64(out, m.accepted);
    for (const std::uint64_t count : m.failed) film::put_u64(out, count);
    film::put_u64(out, m.rays);
  }
  return out;
}

namespace {

constexpr std::size_t kMutationBytes = (3 + kMutationFailures.size()) * 8;  // beside the name

// Counts by mutation, to the end of the bytes. Empty: they are not as encode() makes them.
std::vector<MutationCounts> read_mutations(film::Reader& reader) {
  std::vector<MutationCounts> out(reader.u8());
  if (out.size() > kMaxMutations) return {};
  for (MutationCounts& m : out) {
    m.name = std::string(reader.bytes(reader.u8()));
    m.proposed = reader.u64();
    m.accepted = reader.u64();
    for (std::uint64_t& count : m.failed) count = reader.u64();
    m.rays = reader.u64();
    // Names go on to messages and pages as they are.
    const auto plain = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_'; };
    if (m.name.empty() || m.name.size() > kMaxMutationName ||
        !std::all_of(m.name.begin(), m.name.end(), plain))
      return {};
  }
  if (!reader.ok() || !reader.rest().empty()) return {};
  return out;
}

MollifiedCounts read_mollified(film::Reader& reader) {
  MollifiedCounts m;
  for (double* value : {&m.start_share, &m.large_sum, &m.large_square_sum, &m.large_product_sum, &m.stay_sum})
    *value = std::bit_cast<double>(reader.u64());
  m.lost = reader.u64();
  return m;
}
// A part is at most the whole: of each large step, and so of their sums, which are added in the same order.
bool can_be(const MollifiedCounts& m, const ChainRecord& record) {
  const ChainCounts& c = record.counts;
  const auto within = [](double value, double most) { return value >= 0 && value <= most; };
  return within(m.start_share, 1) && within(m.large_sum, c.large_sum) &&
         within(m.large_square_sum, c.large_square_sum) && within(m.large_product_sum, c.large_square_sum) &&
         within(m.stay_sum, static_cast<double>(c.mutations) * (1 + 1e-9)) && m.lost <= record.segments;
}

// Each proposal is counted once, and each is a mutation of the chain that is no large step.
bool can_be(const ChainCounts& c) {
  std::uint64_t small = c.mutations - c.large_steps, accepted = c.accepted - c.large_accepted;
  for (const MutationCounts& m : c.by_mutation) {
    if (m.proposed > small || m.accepted > m.proposed || m.accepted > accepted) return false;
    small -= m.proposed;
    accepted -= m.accepted;
    std::uint64_t rest = m.proposed - m.accepted;
    for (const std::uint64_t count : m.failed) {
      if (count > rest) return false;
      rest -= count;
    }
  }
  return true;
}

}  // namespace

void add(std::vector<MutationCounts>& sums, std::span<const MutationCounts> counts) {
  for (const MutationCounts& m : counts) {
    auto sum =
        std::find_if(sums.begin(), sums.end(), [&](const MutationCounts& one) { return one.name == m.name; });
    if (sum == sums.end()) {
      sums.push_back({m.name, 0, 0, {}, 0});
      sum = sums.end() - 1;
    }
    sum->proposed += m.proposed;
    sum->accepted += m.accepted;
    for (std::size_t i = 0; i < m.failed.size(); ++i) sum->failed[i] += m.failed[i];
    sum->rays += m.rays;
  }
}

Result<ChainRecord> decode(std::string_view bytes) {
  const auto bad = [](std::string_view what) {
    return input_error(fmt::format("a chain's record cannot be used: {}", what)).with_field("chain_records");
  };
  film::Reader reader(bytes);
  const std::uint32_t magic = reader.u32();
  if (magic != kMagic && magic != kMagicWithMutations && magic != kMagicMollified)
    return bad("it does not start as one");
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
  if (!reader.ok() || reader.rest().size() < length) return bad("its length is wrong");
  if (length > kMaxStateBytes) return bad(fmt::format("its state has more than {} bytes", kMaxStateBytes));
  if (c.accepted > c.mutations || c.large_steps > c.mutations || c.large_accepted > c.large_steps ||
      c.large_accepted > c.accepted || c.longest_stay > c.mutations || c.present_stay > c.longest_stay)
    return bad("its counts contradict each other");
  const auto sum_ok = [](double value) { return std::isfinite(value) && value >= 0; };
  if (!sum_ok(c.large_sum) || !sum_ok(c.large_square_sum) || !std::isfinite(c.stay_x) ||
      !std::isfinite(c.stay_y))
    return bad("a number of it is negative or not finite");
  record.state = std::string(reader.bytes(length));
  if (magic == kMagic && !reader.rest().empty()) return bad("its length is wrong");
  if (magic == kMagic) return record;
  if (magic == kMagicMollified) {
    c.mollified = read_mollified(reader);
    if (!reader.ok()) return bad("its length is wrong");
    if (!can_be(*c.mollified, record)) return bad("its sums of mollified paths contradict the others");
    if (reader.rest() == std::string_view("\0", 1)) return record;
  }
  c.by_mutation = read_mutations(reader);
  if (c.by_mutation.empty()) return bad("its counts by mutation cannot be read");
  if (!can_be(c)) return bad("its counts by mutation contradict the others");
  return record;
}

std::size_t encoded_bytes(const ChainRecord& record) {
  std::size_t mutations = record.counts.by_mutation.empty() && !record.counts.mollified ? 0 : 1;
  if (record.counts.mollified) mutations += kMollifiedBytes;
  for (const MutationCounts& m : record.counts.by_mutation) mutations += 1 + m.name.size() + kMutationBytes;
  return 4 + 9 * 8 + 3 * 4 + record.state.size() + mutations;  // magic, counts and sums, stay and length
}

std::string encode(std::span<const ChainRecord> records) {
  std::string out;
  for (const ChainRecord& record : records) {
    const std::string one = encode(record);
    film::put_u32(out, static_cast<std::uint32_t>(one.size()));
    out += one;
  }
  return out;
}

Result<std::vector<ChainRecord>> decode(std::string_view bytes, std::uint64_t count) {
  const auto bad = [&](std::uint64_t found) {
    return input_error(fmt::format("{} bytes are not {} chains' records: they end in number {}", bytes.size(),
                                   count, found))
        .with_field("chain_records");
  };
  film::Reader reader(bytes);
  std::vector<ChainRecord> records;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint32_t length = reader.u32();
    if (!reader.ok() || reader.rest().size() < length) return bad(i);
    CANDELA_ASSIGN(ChainRecord record, decode(reader.bytes(length)));
    records.push_back(std::move(record));
  }
  if (!reader.rest().empty())
    return input_error(fmt::format("{} bytes follow the {} chains' records", reader.rest().size(), count))
        .with_field("chain_records");
  return records;
}

Result<void> BootstrapTable::insert(std::uint64_t begin, std::span<const float> values) {
  if (begin > samples_ || values.size() > samples_ - begin)
    return input_error(fmt::format("bootstrap samples from {} on, {} of them, lie beyond the {} there are",
                                   begin, values.size(), samples_))
        .with_field("contributions");
  for (const float value : values)
    if (!std::isfinite(value) || value < 0)
      return input_error("a bootstrap sample is negative or not finite").with_field("contributions");
  values_.resize(samples_);
  if (!known_.insert(begin, begin + values.size()))
    return refused_error(fmt::format("bootstrap samples from {} on are known already", begin))
        .with_field("contributions");
  std::copy(values.begin(), values.end(), values_.begin() + static_cast<std::ptrdiff_t>(begin));
  return {};
}

BootstrapSums BootstrapTable::sums() const {
  BootstrapSums sums;
  sums.samples = samples_;
  for (const float value : values_) {
    sums.sum += static_cast<double>(value);
    sums.square_sum += static_cast<double>(value) * static_cast<double>(value);
  }
  return sums;
}

Normalisation BootstrapTable::normalisation() const {
  return pool(*this, {});
}

std::vector<std::uint64_t> BootstrapTable::choose_starts(std::uint32_t chains, std::uint64_t seed) const {
  const double sum = sums().sum;
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
  const auto shuffle = [&](std::span<std::uint64_t> some) {
    for (std::size_t i = some.size(); i > 1; --i) {
      const auto j = static_cast<std::size_t>(stream.next_double() * static_cast<double>(i));
      std::swap(some[i - 1], some[j]);
    }
  };
  if (std::ranges::adjacent_find(starts) == starts.end()) {
    shuffle(starts);
    return starts;
  }
  // Halves that begin at one bright sample agree on a spike: their difference, which the shown error is
  // estimated from, does not have it. The comb begins with the sample that starts most chains, so that only
  // a sample of fewer, in the middle, may start chains of both.
  auto most = starts.begin(), longest_end = starts.begin();
  for (auto begin = starts.begin(); begin != starts.end();) {
    const auto end = std::upper_bound(begin, starts.end(), *begin);
    if (end - begin > longest_end - most) {
      most = begin;
      longest_end = end;
    }
    begin = end;
  }
  std::rotate(starts.begin(), most, starts.end());
  std::span<std::uint64_t> first = std::span(starts).first(chains / 2);
  std::span<std::uint64_t> second = std::span(starts).subspan(chains / 2);
  if (stream.next_double() < 0.5) std::swap(first, second);
  shuffle(first);
  shuffle(second);
  std::vector<std::uint64_t> apart;
  apart.reserve(chains);
  for (std::size_t i = 0; i < first.size(); ++i) {
    apart.push_back(first[i]);
    apart.push_back(second[i]);
  }
  return apart;
}

int film_scale_log2(double b0, int pilot_scale_log2) {
  // Light that needs no chain may be far brighter than b0, and has to fit, too. The least importance of two
  // stages takes 2^10 of the 2^15 segments that a unit has room for.
  constexpr int kFinest = 16;  // over the pilot's, which is the scale of the whole image
  return b0 > 0 ? std::min(film::scale_log2_for(b0), pilot_scale_log2 + kFinest) : pilot_scale_log2;
}

Normalisation pool(const BootstrapTable& bootstrap, std::span<const ChainCounts> counts) {
  return pool(bootstrap.sums(), counts);
}

Normalisation pool(const BootstrapSums& bootstrap, std::span<const ChainCounts> counts) {
  BootstrapSums all = bootstrap;
  for (const ChainCounts& c : counts) {
    all.sum += c.large_sum;
    all.square_sum += c.large_square_sum;
    all.samples += c.large_steps;
  }
  const std::optional<MollifiedSums> parts = mollified_sums(counts);
  if (!parts) return from_sums(all.sum, all.square_sum, all.samples);
  // b_reg + b_irr. The radius changes nothing of regular paths: their variance is that of the large steps,
  // for the bootstrap, too.
  const auto n = static_cast<double>(bootstrap.samples);
  const double large = parts->steps, both = n + large, share = parts->start_share;
  Normalisation result;
  result.samples = all.samples;
  const double regular = bootstrap.sum * (1 - share) + parts->regular_mean * large;
  result.b = regular / both + parts->mean;
  const double variance =
                   parts->regular_variance / both + parts->variance / large + 2 * parts->covariance / both,
               shared = bootstrap.sum / both;
  result.standard_error =
      std::sqrt(std::max(0.0, variance) + shared * shared * share * (1 - share) / parts->chains);
  return result;
}

std::optional<MollifiedSummary> summarise_mollified(std::span<const ChainCounts> counts) {
  const std::optional<MollifiedSums> parts = mollified_sums(counts);
  if (!parts) return std::nullopt;
  MollifiedSummary out;
  out.b = parts->mean;
  out.standard_error = std::sqrt(parts->variance / parts->steps);
  double squares = 0;
  for (const ChainCounts& c : counts) {
    if (!c.mollified || c.mutations == 0) continue;
    const double share = c.mollified->stay_sum / static_cast<double>(c.mutations);
    out.share += share / parts->chains;
    squares += share * share / parts->chains;
    out.lost += c.mollified->lost;
  }
  out.share_spread = std::sqrt(std::max(0.0, squares - out.share * out.share));
  return out;
}

film::Development development(double bootstrap_b, const Normalisation& normalisation) {
  film::Development out;
  out.two_layers = true;
  if (!(bootstrap_b > 0)) return out;
  out.factor = normalisation.b / bootstrap_b;
  const double relative = normalisation.standard_error / normalisation.b;
  out.factor_variance = relative * relative;
  return out;
}

Result<std::vector<std::uint64_t>> segments_in(const film::IndexSet& merged, std::uint32_t chains) {
  const std::uint64_t n = chains / 2;
  std::uint64_t each = 0;                  // whole rounds within ranges
  std::vector<std::int64_t> steps(n + 1);  // differences, chain by chain, of what ranges have beyond those
  for (const auto& [begin, end] : merged.ranges()) {
    if (end > n) {  // each index from n on needs the one a round before
      const std::uint64_t from = std::max(begin, n) - n;
      const auto [gap, gap_end] = merged.first_gap(from, end - n);
      if (gap != gap_end)
        return input_error(fmt::format("segment {} of a chain is merged without the one before it",
                                       segment_of(gap + n, chains)))
            .with_field("merged");
    }
    each += (end - begin) / n;
    const std::uint64_t first = begin % n, rest = (end - begin) % n;
    ++steps[first];
    --steps[std::min(first + rest, n)];
    if (first + rest > n) {
      ++steps[0];
      --steps[first + rest - n];
    }
  }
  std::vector<std::uint64_t> out(n);
  std::int64_t more = 0;
  for (std::uint64_t i = 0; i < n; ++i) {
    more += steps[i];
    out[i] = each + static_cast<std::uint64_t>(more);
  }
  return out;
}

Summary summarise(const BootstrapSums& bootstrap, std::span<const ChainCounts> counts) {
  Summary out;
  out.normalisation = pool(bootstrap, counts);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const ChainCounts& c = counts[i];
    ChainCounts& group = out.groups[i % kGroups];
    group.mutations += c.mutations;
    group.accepted += c.accepted;
    group.large_steps += c.large_steps;
    group.large_accepted += c.large_accepted;
    group.large_sum += c.large_sum;
    group.large_square_sum += c.large_square_sum;
    group.present_stay = std::max(group.present_stay, c.present_stay);
    add(group.by_mutation, c.by_mutation);
    if (c.longest_stay <= group.longest_stay) continue;
    group.longest_stay = c.longest_stay;
    group.stay_x = c.stay_x;
    group.stay_y = c.stay_y;
  }
  return out;
}

std::vector<MutationCounts> by_mutation(const Summary& summary) {
  std::vector<MutationCounts> out;
  for (const ChainCounts& group : summary.groups) add(out, group.by_mutation);
  return out;
}

const ChainCounts& longest_stay(const Summary& summary) {
  return *std::max_element(summary.groups.begin(), summary.groups.end(),
                           [](const auto& a, const auto& b) { return a.longest_stay < b.longest_stay; });
}

std::string long_stay_text(const Summary& summary) {
  const ChainCounts& longest = longest_stay(summary);
  // Without light the chains stand still, which is no news.
  if (longest.longest_stay <= kLongStay || !(summary.normalisation.b > 0)) return {};
  return fmt::format(
      "a chain stayed on one path for {} mutations, which may show as a bright dot at pixel {:.0f}, {:.0f}",
      longest.longest_stay, std::floor(longest.stay_x), std::floor(longest.stay_y));
}

}  // namespace candela::chains
