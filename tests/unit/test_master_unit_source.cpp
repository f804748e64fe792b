// Unit sources by themselves: what they cut, take back and claim.
#include <gtest/gtest.h>

#include <ostream>

#include "common/rng/stream.h"
#include "master/scheduler/unit_source.h"

namespace candela::master {
namespace {

JobRow row_of(bool chains, bool decided) {
  JobRow row;
  if (chains) row.chains = ChainPlan{12, 100, 10};
  if (decided) row.named_state = NamedState{};
  return row;
}

struct Case {
  const char* name;
  bool chains, decided;
  Unit::Kind kind;
};
void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name;
}
class UnitSources : public ::testing::TestWithParam<Case> {
 protected:
  // Merges the unit in the source's own way.
  void merge(const Unit& unit) {
    if (source->table() != nullptr) {
      ASSERT_TRUE(source->add(unit, std::vector<float>(unit.end - unit.begin, 1.0F)).ok());
    } else if (source->makes_film()) {
      ASSERT_TRUE(merged[unit.half].insert(unit.begin, unit.end));
    }
  }
  JobView view() const { return {merged, {36, 36}, {36, 36}, true, 2, 0, {}, {}}; }
  std::unique_ptr<UnitSource> source = make_source(row_of(GetParam().chains, GetParam().decided));
  HalfSets merged;
};

// Claim: whatever is cut, put back, taken again after a restart or merged, in any order, no index is in two
// units at a time, what is put back is cut again, and the units together are the whole stage.
TEST_P(UnitSources, TileTheirStage) {
  EXPECT_EQ(source->kind(), GetParam().kind);
  if (!source->makes_film() && source->table() == nullptr) return;  // the pilot has no indices
  rng::Stream stream(rng::key(5, static_cast<std::uint64_t>(GetParam().kind)));
  std::vector<Unit> held;
  HalfSets live;
  std::uint64_t done = 0;
  const auto drop = [&](std::size_t i) {
    const Unit unit = held[i];
    held.erase(held.begin() + static_cast<std::ptrdiff_t>(i));
    film::IndexSet part;
    part.insert(unit.begin, unit.end);
    live[unit.half] = without(live[unit.half], part);
    return unit;
  };
  const std::uint64_t all = source->extent(view()).remaining;
  for (int step = 0; step < 100000 && done < all; ++step) {
    const double u = stream.next_double();
    if (u < 0.5) {
      const bool expected = source->has_unit(view());
      const auto unit = source->cut(view(), 1 + static_cast<std::uint64_t>(stream.next_double() * 5));
      ASSERT_EQ(unit.has_value(), expected);
      if (!unit) continue;
      ASSERT_TRUE(live[unit->half].insert(unit->begin, unit->end)) << "in two units";
      ASSERT_EQ(source->claim(merged, *unit), Claim::open);
      held.push_back(*unit);
    } else if (!held.empty()) {
      const Unit unit = drop(static_cast<std::size_t>(u * 1000) % held.size());
      if (u < 0.6) {
        source->put_back(unit);
      } else {
        merge(unit);
        done += unit.end - unit.begin;
        ASSERT_EQ(source->claim(merged, unit), Claim::merged);
      }
    }
    if (u > 0.98) {  // a restart: some of the units come back from the store
      source->restart(merged);
      std::vector<Unit> kept;
      for (const Unit& unit : held)
        if (stream.next_double() < 0.5) kept.push_back(unit);
      held.clear();
      live = {};
      for (const Unit& unit : kept) {
        ASSERT_TRUE(source->take(view(), unit));
        ASSERT_FALSE(source->take(view(), unit)) << "taken twice";
        ASSERT_TRUE(live[unit.half].insert(unit.begin, unit.end));
        held.push_back(unit);
      }
    }
  }
  EXPECT_EQ(done, all);
  EXPECT_FALSE(source->has_unit(view()));
  EXPECT_EQ(source->extent(view()).remaining, 0U);
}

// Claim: a source claims no unit of a stage that has not begun; one of a stage that is over counts as merged.
TEST_P(UnitSources, ClaimTheirOwnKind) {
  for (const Unit::Kind kind :
       {Unit::Kind::pilot, Unit::Kind::iterations, Unit::Kind::bootstrap, Unit::Kind::segments}) {
    const Unit unit{kind, 0, 0, 3};
    const bool over = kind == Unit::Kind::bootstrap && GetParam().kind == Unit::Kind::segments;
    const Claim expected = kind == GetParam().kind ? Claim::open : over ? Claim::merged : Claim::foreign;
    EXPECT_EQ(source->claim(merged, unit), expected) << static_cast<int>(kind);
    if (kind != GetParam().kind) {
      EXPECT_FALSE(source->take(view(), unit));
    }
  }
  EXPECT_EQ(source->claim(merged, Unit{Unit::Kind::iterations, 2, 0, 3}), Claim::foreign);
}

INSTANTIATE_TEST_SUITE_P(Stages, UnitSources,
                         ::testing::Values(Case{"pilot", false, false, Unit::Kind::pilot},
                                           Case{"iterations", false, true, Unit::Kind::iterations},
                                           Case{"bootstrap", true, false, Unit::Kind::bootstrap},
                                           Case{"segments", true, true, Unit::Kind::segments}),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace candela::master
