// Segments of Markov chains: a segment can be cut when its chain's segment before is merged. A straggler
// holds up its own chains, and the segments behind them are skipped. If the job has epochs, each segment
// starts from the state of its epoch, too.
#include <fmt/format.h>

#include <algorithm>

#include "master/scheduler/free_segments.h"
#include "master/scheduler/open_epochs.h"
#include "master/scheduler/unit_source.h"

namespace candela::master {
namespace {

// Bytes of chain records that a lease carries at most, by the largest record known.
constexpr std::size_t kMaxLeaseBytes = 2 << 20;
// A unit holds at most this part of the chains for each worker: one unit is rendered, one waits and one is on
// its way, and none of their chains can go on meanwhile.
constexpr std::uint64_t kUnitsPerWorker = 4;

class SegmentSource final : public UnitSource {
 public:
  SegmentSource(const ChainPlan& plan, const std::optional<EpochPlan>& epochs)
      : chains_(plan.chains), per_round_(plan.chains / 2), epochs_(epochs) {}
  Unit::Kind kind() const override { return Unit::Kind::segments; }
  StageCost cost() const override {
    StageCost cost;
    cost.serial = true;
    return cost;
  }
  std::string_view noun() const override { return "chain segments"; }

  std::optional<Unit> cut(const JobView& job, std::uint64_t want) override {
    want = std::min(want, max_unit(job));
    std::uint32_t half = half_behind();
    for (int i = 0; i < 2; ++i, half = 1 - half) {
      const SegmentRun run =
          free_segments(job.merged[half], reserved_[half], per_round_, epochs_.open_end(job, half), want);
      if (run.length == 0) continue;
      const Unit unit{kind(), half, run.begin,
                      std::min(run.begin + std::min(run.length, want), epochs_.unit_end(job, run.begin))};
      reserved_[half].insert(unit.begin, unit.end);
      return unit;
    }
    return std::nullopt;
  }
  bool has_unit(const JobView& job) const override {
    for (std::uint32_t h = 0; h < 2; ++h)
      if (free_segments(job.merged[h], reserved_[h], per_round_, epochs_.open_end(job, h), 1).length > 0)
        return true;
    return false;
  }
  Extent extent(const JobView& job) const override { return film_extent(job, reserved_); }
  std::uint64_t open_indices(const JobView& job) const override {
    return std::min<std::uint64_t>(chains_, epochs_.open_indices(job));
  }
  std::uint64_t max_unit(const JobView& job) const override {
    const std::uint64_t share = chains_ / (kUnitsPerWorker * std::max<std::uint64_t>(job.active_workers, 1));
    std::uint64_t most = std::min(per_round_, std::max<std::uint64_t>(share, 1));
    if (job.record_bytes > 0)
      most = std::min<std::uint64_t>(most, std::max<std::size_t>(kMaxLeaseBytes / job.record_bytes, 1));
    return most;
  }
  Claim claim(const HalfSets& merged, const Unit& unit) const override {
    if (unit.kind == Unit::Kind::bootstrap) return Claim::merged;  // its stage is over
    return UnitSource::claim(merged, unit);
  }
  std::optional<std::uint64_t> due_decision(const JobView& job) const override {
    return epochs_.due_decision(job);
  }
  bool complete(const HalfSets& indices, std::string& why) const override {
    for (const film::IndexSet& half : indices)
      for (const auto& [begin, end] : half.ranges()) {
        if (end <= per_round_) continue;
        const std::uint64_t first = std::max(begin, per_round_) - per_round_;
        const auto [gap, gap_end] = half.first_gap(first, end - per_round_);
        if (gap == gap_end) continue;
        why =
            fmt::format("segment {} goes on from segment {}, which is not asked for", gap + per_round_, gap);
        return false;
      }
    return epochs_.complete(indices, why);
  }
  bool needs_film() const override { return true; }
  UnitInput input(const JobView& job, const Unit& unit, FilmInputs::Records records) const override {
    UnitInput out{{}, epochs_.states(job, unit)};
    for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
      const std::uint64_t chain = chains::chain_of(unit.half, i, chains_);
      UnitStart start;
      // A bootstrap that found nothing has no starts, and any number serves.
      if (chain < job.chain_starts.size()) start.bootstrap_sample = job.chain_starts[chain];
      if (i - unit.begin < records.size()) start.record = std::move(records[i - unit.begin]);
      out.chain_starts.push_back(std::move(start));
    }
    return out;
  }

 protected:
  bool ready(const JobView& job, const Unit& unit) const override {
    if (unit.end - unit.begin > per_round_ || !epochs_.holds(job, unit)) return false;
    if (unit.end <= per_round_) return true;
    const std::uint64_t first = std::max(unit.begin, per_round_) - per_round_;
    return contains(job.merged[unit.half], first, unit.end - per_round_);
  }

 private:
  const std::uint32_t chains_;
  const std::uint64_t per_round_;  // chains of a half
  const OpenEpochs epochs_;
};

}  // namespace

std::unique_ptr<UnitSource> make_segment_source(const ChainPlan& plan,
                                                const std::optional<EpochPlan>& epochs) {
  return std::make_unique<SegmentSource>(plan, epochs);
}

}  // namespace candela::master
