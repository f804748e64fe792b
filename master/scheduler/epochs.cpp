// Iterations in epochs: no unit crosses a border, and an epoch is open when its state is decided. The state
// of epoch e is decided when all units of the epochs below e - lag are merged, so lag + 1 epochs are open at
// a time and no worker waits at a border.
#include "common/stages/epochs.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/stats/movement_sums.h"
#include "master/scheduler/unit_source.h"

namespace candela::master {
namespace {

class EpochSource final : public UnitSource {
 public:
  EpochSource(const EpochPlan& plan, bool in_groups)
      : epochs_(plan.first, plan.growth), lag_(plan.lag), in_groups_(in_groups) {}
  Unit::Kind kind() const override { return Unit::Kind::iterations; }

  std::optional<Unit> cut(const JobView& job, std::uint64_t want) override {
    std::uint32_t half = half_behind();
    for (int i = 0; i < 2; ++i, half = 1 - half) {
      auto [begin, end] = reserved_[half].first_gap(0, open_end(job, half));
      if (begin == end) continue;
      if (in_groups_) end = std::min(end, stats::end_of_group(begin));
      const std::uint64_t epoch = epochs_.of_index(begin);
      const std::uint64_t border = epochs_.begin_index(epoch + 1);
      // Every worker gets some units of an epoch, since all wait for its last one.
      const std::uint64_t length = border - epochs_.begin_index(epoch);
      const std::uint64_t most =
          std::max<std::uint64_t>(length / std::max<std::uint64_t>(job.active_workers, 1), 1);
      const Unit unit{kind(), half, begin, std::min({end, border, begin + std::min(want, most)})};
      reserved_[half].insert(unit.begin, unit.end);
      return unit;
    }
    return std::nullopt;
  }
  bool has_unit(const JobView& job) const override {
    for (std::uint32_t h = 0; h < 2; ++h)
      if (!contains(reserved_[h], 0, open_end(job, h))) return true;
    return false;
  }
  Extent extent(const JobView& job) const override { return film_extent(job, reserved_); }
  std::uint64_t open_indices(const JobView& job) const override {
    std::uint64_t open = 0;
    for (std::uint32_t h = 0; h < 2; ++h) {
      const std::uint64_t end = open_end(job, h);
      const std::uint64_t lacking = missing(job.merged[h], end);
      open += lacking - std::min(lacking, job.unwanted[h]);
    }
    return open;
  }
  UnitInput input(const JobView& job, const Unit& unit, FilmInputs::Records) const override {
    return {{}, {job.states[epochs_.of_index(unit.begin)]}};
  }
  std::optional<std::uint64_t> due_decision(const JobView& job) const override {
    const std::uint64_t epoch = job.states.size();
    const std::uint64_t begin = epochs_.begin_index(epoch);
    if (begin >= job.target[0] && begin >= job.target[1]) return std::nullopt;  // the job does not get there
    const std::uint64_t needed = epochs_.begin_index(epochs_before(epoch, lag_));
    for (std::uint32_t h = 0; h < 2; ++h)
      if (!contains(job.merged[h], 0, needed)) return std::nullopt;
    return epoch;
  }
  bool complete(const HalfSets& indices, std::string& why) const override {
    const std::uint64_t end = std::max(end_of(indices[0]), end_of(indices[1]));
    if (end == 0) return true;
    const std::uint64_t last = epochs_.of_index(end - 1);
    const std::uint64_t needed = epochs_.begin_index(epochs_before(last, lag_));
    for (const film::IndexSet& half : indices) {
      if (contains(half, 0, needed)) continue;
      why = fmt::format(
          "the state of epoch {}, which index {} is in, is decided from all indices below {} of "
          "both halves",
          last, end - 1, needed);
      return false;
    }
    return true;
  }

 protected:
  bool ready(const JobView& job, const Unit& unit) const override {
    const std::uint64_t epoch = epochs_.of_index(unit.begin);
    return epoch < job.states.size() && unit.end <= epochs_.begin_index(epoch + 1);
  }

 private:
  // One past the last index of a half that can be rendered now.
  std::uint64_t open_end(const JobView& job, std::uint32_t half) const {
    return std::min(job.open_to[half], epochs_.begin_index(job.states.size()));
  }

  const Epochs epochs_;
  const std::uint32_t lag_;
  const bool in_groups_;
};

}  // namespace

std::unique_ptr<UnitSource> make_epoch_source(const EpochPlan& plan, bool in_groups) {
  return std::make_unique<EpochSource>(plan, in_groups);
}

}  // namespace candela::master
