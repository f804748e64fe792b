// Iterations: any range of a half that nobody has, within one open epoch if the job has epochs.
#include <algorithm>

#include "common/stats/movement_sums.h"
#include "master/scheduler/open_epochs.h"
#include "master/scheduler/unit_source.h"

namespace candela::master {
namespace {

class IterationSource final : public UnitSource {
 public:
  IterationSource(const std::optional<EpochPlan>& epochs, bool in_groups)
      : epochs_(epochs), in_groups_(in_groups) {}
  Unit::Kind kind() const override { return Unit::Kind::iterations; }
  std::optional<Unit> cut(const JobView& job, std::uint64_t want) override {
    std::uint32_t half = half_behind();
    for (int i = 0; i < 2; ++i, half = 1 - half) {
      auto [begin, end] = reserved_[half].first_gap(0, epochs_.open_end(job, half));
      if (begin == end) continue;
      if (in_groups_) end = std::min(end, stats::end_of_group(begin));
      const Unit unit{kind(), half, begin,
                      std::min(begin + std::min(want, end - begin), epochs_.unit_end(job, begin))};
      reserved_[half].insert(unit.begin, unit.end);
      return unit;
    }
    return std::nullopt;
  }
  bool has_unit(const JobView& job) const override {
    return !contains(reserved_[0], 0, epochs_.open_end(job, 0)) ||
           !contains(reserved_[1], 0, epochs_.open_end(job, 1));
  }
  Extent extent(const JobView& job) const override { return film_extent(job, reserved_); }
  std::uint64_t open_indices(const JobView& job) const override { return epochs_.open_indices(job); }
  UnitInput input(const JobView& job, const Unit& unit, FilmInputs::Records) const override {
    return {{}, epochs_.states(job, unit)};
  }
  std::optional<std::uint64_t> due_decision(const JobView& job) const override {
    return epochs_.due_decision(job);
  }
  bool complete(const HalfSets& indices, std::string& why) const override {
    return epochs_.complete(indices, why);
  }

 protected:
  bool ready(const JobView& job, const Unit& unit) const override { return epochs_.holds(job, unit); }

 private:
  const OpenEpochs epochs_;
  const bool in_groups_;
};

}  // namespace

std::unique_ptr<UnitSource> make_iteration_source(const std::optional<EpochPlan>& epochs, bool in_groups) {
  return std::make_unique<IterationSource>(epochs, in_groups);
}

}  // namespace candela::master
