// The bootstrap of Markov chains: samples in any order, whose contributions fill one table.
#include <fmt/format.h>

#include <algorithm>

#include "master/scheduler/unit_source.h"

namespace candela::master {
namespace {

class BootstrapSource final : public UnitSource {
 public:
  explicit BootstrapSource(const ChainPlan& plan) : plan_(plan), table_(plan.bootstrap_samples) {}
  Unit::Kind kind() const override { return Unit::Kind::bootstrap; }
  // A sample costs as much as a mutation; an iteration of a job of chains is a segment.
  StageCost cost() const override { return {static_cast<double>(plan_.segment_mutations), 0, 1, true}; }
  bool makes_film() const override { return false; }
  std::string_view noun() const override { return "bootstrap samples"; }

  std::optional<Unit> cut(const JobView&, std::uint64_t want) override {
    const auto [begin, end] = reserved_[0].first_gap(0, plan_.bootstrap_samples);
    if (begin == end) return std::nullopt;
    const Unit unit{kind(), 0, begin, std::min(end, begin + want)};
    reserved_[0].insert(unit.begin, unit.end);
    return unit;
  }
  bool has_unit(const JobView&) const override { return reserved_[0].count() < plan_.bootstrap_samples; }
  Extent extent(const JobView&) const override {
    const std::uint64_t cut = reserved_[0].count();
    return {plan_.bootstrap_samples - cut, cut, true};
  }
  std::uint64_t open_indices(const JobView&) const override {
    return plan_.bootstrap_samples - table_.known().count();
  }
  bool take(const JobView& job, const Unit& unit) override {
    return unit.end <= plan_.bootstrap_samples && UnitSource::take(job, unit);
  }
  void restart(const HalfSets&) override { reserved_ = {table_.known(), {}}; }

  Claim claim(const HalfSets&, const Unit& unit) const override {
    if (unit.kind != kind() || unit.half != 0) return Claim::foreign;
    return table_.known().intersects(unit.begin, unit.end) ? Claim::merged : Claim::open;
  }
  const chains::BootstrapTable* table() const override { return &table_; }
  Result<void> add(const Unit& unit, std::span<const float> values) override {
    const std::uint64_t samples = unit.end - unit.begin;
    if (values.size() != samples)
      return input_error(fmt::format("{} contributions, the unit has {} samples", values.size(), samples))
          .with_field("contributions");
    return table_.insert(unit.begin, values);
  }

 private:
  const ChainPlan plan_;
  chains::BootstrapTable table_;
};

}  // namespace

std::unique_ptr<UnitSource> make_bootstrap_source(const ChainPlan& plan) {
  return std::make_unique<BootstrapSource>(plan);
}

}  // namespace candela::master
