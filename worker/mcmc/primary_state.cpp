#include "worker/mcmc/primary_state.h"

#include <fmt/format.h>

#include "common/chains/chains.h"
#include "common/film/codec.h"
#include "worker/core/math.h"

namespace candela::mcmc {
namespace {

constexpr std::uint32_t kMagic = 0x31535043;        // "CPS1"
constexpr std::uint64_t kMissedSteps = 1ULL << 32;  // beside the dimensions, in hashes

// Every number of every walk stored: magic, key, time, and for each walk a count, a bit each, and the numbers
// with their times.
constexpr std::size_t kLargest =
    4 + 8 + 8 + PrimaryState::kWalks * 4 +
    2 * ((PrimarySampler::kMaxDimensions + 7) / 8 + 16 * PrimarySampler::kMaxDimensions) + (8 + 16 * 64);
static_assert(kLargest <= chains::kMaxStateBytes);
// Maximum dimensions of a choice of techniques.
constexpr std::uint32_t kChoiceDimensions = 64;

std::uint32_t most_dimensions(std::size_t walk) {
  return walk == PrimaryState::choice ? kChoiceDimensions : PrimarySampler::kMaxDimensions;
}

}  // namespace

template <bool kPair>
void PrimarySampler::move(Point& p, std::uint64_t random) const {
  const auto moved = [&](std::uint32_t from, std::uint32_t bits) {
    const double share = static_cast<double>(bits >> 1) * 0x1p-31;
    const double distance = state_->most_ * math::exp(-state_->log_ratio_ * share);
    const auto steps = static_cast<std::uint32_t>(distance * 0x1p32);
    return (bits & 1) != 0 ? from + steps : from - steps;  // around the circle
  };
  p.x = moved(p.x, static_cast<std::uint32_t>(random));
  if constexpr (kPair) p.y = moved(p.y, static_cast<std::uint32_t>(random >> 32));
}

template <bool kPair>
Point PrimarySampler::read(std::uint32_t dimension) {
  PrimaryState& state = *state_;
  if (state.mode_ == PrimaryState::Mode::large) return fresh(proposal_key_, dimension);
  if (dimension >= kMaxDimensions) return fresh(base_key_, dimension);
  if (dimension >= entries_.size()) entries_.resize(dimension + 1);
  Entry& entry = entries_[dimension];
  if (entry.epoch != state.epoch_) {
    entry = {};
    entry.value = fresh(base_key_, dimension);
    entry.epoch = state.epoch_;
  }
  if (state.mode_ == PrimaryState::Mode::present || entry.stamp == state.stamp_) return entry.value;
  if (entry.time < state.now_) {
    rng::Stream missed(rng::combine(proposal_key_, kMissedSteps | dimension));
    for (; entry.time < state.now_; ++entry.time) move<kPair>(entry.value, missed.next_u64());
  }
  entry.before = entry.value;
  const Point random = fresh(proposal_key_, dimension);
  move<kPair>(entry.value, (static_cast<std::uint64_t>(random.y) << 32) | random.x);
  ++entry.time;
  entry.stamp = state.stamp_;
  moved_.push_back(dimension);
  return entry.value;
}

template Point PrimarySampler::read<false>(std::uint32_t);
template Point PrimarySampler::read<true>(std::uint32_t);

double PrimarySampler::draw_fixed(std::uint32_t dimension) const {
  const Point p = fresh(state_->mode_ == PrimaryState::Mode::large ? proposal_key_ : base_key_, dimension);
  return rng::to_double((static_cast<std::uint64_t>(p.x) << 32) | p.y);
}

PrimaryState::PrimaryState(StepSizes sizes)
    : most_(sizes.most), log_ratio_(math::log(sizes.most / sizes.least)) {
  for (PrimarySampler& sampler : samplers_) sampler.state_ = this;
}

void PrimaryState::set_base(std::uint64_t key) {
  base_ = key;
  now_ = 0;
  ++epoch_;
  for (std::size_t i = 0; i < kWalks; ++i) samplers_[i].base_key_ = rng::combine(key, i);
}

void PrimaryState::start(std::uint64_t key) {
  mode_ = Mode::present;
  set_base(key);
}

void PrimaryState::propose(std::uint64_t key, bool large) {
  mode_ = large ? Mode::large : Mode::small;
  proposal_ = key;
  ++stamp_;
  for (std::size_t i = 0; i < kWalks; ++i) {
    samplers_[i].proposal_key_ = rng::combine(key, i);
    samplers_[i].moved_.clear();
  }
}

void PrimaryState::accept() {
  if (mode_ == Mode::large)
    set_base(proposal_);
  else
    ++now_;
  mode_ = Mode::present;
}

void PrimaryState::reject() {
  if (mode_ == Mode::small) {
    for (PrimarySampler& sampler : samplers_) {
      for (const std::uint32_t dimension : sampler.moved_) {
        PrimarySampler::Entry& entry = sampler.entries_[dimension];
        entry.value = entry.before;
        --entry.time;
        entry.stamp = 0;
      }
    }
  }
  mode_ = Mode::present;
}

std::string PrimaryState::save() const {
  std::string out;
  film::put_u32(out, kMagic);
  film::put_u64(out, base_);
  film::put_u64(out, now_);
  for (const PrimarySampler& sampler : samplers_) {
    // Numbers that no step moved are functions of the key.
    const auto stored = [&](const PrimarySampler::Entry& e) { return e.epoch == epoch_ && e.time > 0; };
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < sampler.entries_.size(); ++i)
      if (stored(sampler.entries_[i])) count = i + 1;
    film::put_u32(out, count);
    std::string bits((count + 7) / 8, '\0');
    for (std::uint32_t i = 0; i < count; ++i)
      if (stored(sampler.entries_[i])) bits[i / 8] = static_cast<char>(bits[i / 8] | (1 << (i % 8)));
    out += bits;
    for (std::uint32_t i = 0; i < count; ++i) {
      const PrimarySampler::Entry& entry = sampler.entries_[i];
      if (!stored(entry)) continue;
      film::put_u32(out, entry.value.x);
      film::put_u32(out, entry.value.y);
      film::put_u64(out, entry.time);
    }
  }
  return out;
}

Result<void> PrimaryState::restore(std::string_view bytes) {
  const auto bad = [](std::string_view what) {
    return input_error(fmt::format("a chain's state cannot be used: {}", what)).with_field("state");
  };
  film::Reader reader(bytes);
  if (reader.u32() != kMagic) return bad("it is not one of primary samples");
  start(reader.u64());
  now_ = reader.u64();
  for (std::size_t walk = 0; walk < kWalks; ++walk) {
    PrimarySampler& sampler = samplers_[walk];
    const std::uint32_t count = reader.u32();
    const std::uint32_t most = most_dimensions(walk);
    if (!reader.ok() || count > most || reader.rest().size() < (count + 7) / 8)
      return bad("a count is wrong");
    std::vector<std::uint8_t> bits((count + 7) / 8);
    for (std::uint8_t& byte : bits) byte = reader.u8();
    if (sampler.entries_.size() < count) sampler.entries_.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) {
      if ((bits[i / 8] >> (i % 8) & 1) == 0) continue;
      PrimarySampler::Entry& entry = sampler.entries_[i];
      entry = {};
      entry.value.x = reader.u32();
      entry.value.y = reader.u32();
      entry.time = reader.u64();
      entry.epoch = epoch_;
      if (!reader.ok() || entry.time == 0 || entry.time > now_)
        return bad("a number of it is from the future");
    }
  }
  if (!reader.ok() || !reader.rest().empty()) return bad("its length is wrong");
  return {};
}

}  // namespace candela::mcmc
