// Iterations: any range of a half that nobody has.
#include <algorithm>

#include "common/stats/movement_sums.h"
#include "master/scheduler/unit_source.h"

namespace candela::master {
namespace {

class IterationSource final : public UnitSource {
 public:
  explicit IterationSource(bool in_groups) : in_groups_(in_groups) {}
  Unit::Kind kind() const override { return Unit::Kind::iterations; }
  std::optional<Unit> cut(const JobView& job, std::uint64_t want) override {
    std::uint32_t half = half_behind();
    for (int i = 0; i < 2; ++i, half = 1 - half) {
      auto [begin, end] = reserved_[half].first_gap(0, job.open_to[half]);
      if (begin == end) continue;
      if (in_groups_) end = std::min(end, stats::end_of_group(begin));
      const Unit unit{kind(), half, begin, begin + std::min(want, end - begin)};
      reserved_[half].insert(unit.begin, unit.end);
      return unit;
    }
    return std::nullopt;
  }
  bool has_unit(const JobView& job) const override {
    return !contains(reserved_[0], 0, job.open_to[0]) || !contains(reserved_[1], 0, job.open_to[1]);
  }
  Extent extent(const JobView& job) const override { return film_extent(job, reserved_); }

 private:
  const bool in_groups_;
};

}  // namespace

std::unique_ptr<UnitSource> make_iteration_source(bool in_groups) {
  return std::make_unique<IterationSource>(in_groups);
}

}  // namespace candela::master
