// The pilot: one unit without indices.
#include <utility>

#include "master/scheduler/unit_source.h"

namespace candela::master {
namespace {

class PilotSource final : public UnitSource {
 public:
  Unit::Kind kind() const override { return Unit::Kind::pilot; }
  // Its seconds are not known; it compiles the scene as well.
  StageCost cost() const override { return {1, 1, 60}; }
  bool makes_film() const override { return false; }
  std::optional<Unit> cut(const JobView&, std::uint64_t) override {
    if (taken_one_) return std::nullopt;
    taken_one_ = true;
    return Unit{Unit::Kind::pilot, 0, 0, 0};
  }
  bool has_unit(const JobView&) const override { return !taken_one_; }
  Extent extent(const JobView&) const override { return {taken_one_ ? 0U : 1U, taken_one_ ? 1U : 0U, false}; }
  std::uint64_t open_indices(const JobView&) const override { return 1; }
  bool take(const JobView&, const Unit& unit) override {
    return unit.kind == Unit::Kind::pilot && !std::exchange(taken_one_, true);
  }
  void put_back(const Unit&) override { taken_one_ = false; }
  void restart(const HalfSets&) override { taken_one_ = false; }

 private:
  bool taken_one_ = false;
};

}  // namespace

std::unique_ptr<UnitSource> make_pilot_source() {
  return std::make_unique<PilotSource>();
}

}  // namespace candela::master
