// Messages of jobs of Markov chains: round trips, and one error naming the field for each bad
// value.
#include <gtest/gtest.h>

#include <cmath>

#include "common/wire/wire.h"

namespace candela {
namespace {

// Claim: units of the new kinds round-trip; a bootstrap has no halves, an end within its bound, and is not
// empty.
TEST(WireChains, Units) {
  for (const Unit& unit :
       {Unit{Unit::Kind::bootstrap, 0, 100, 4000}, Unit{Unit::Kind::segments, 1, 17, 42}}) {
    v1::Unit message;
    wire::to_proto(unit, message);
    const auto back = wire::from_proto(message);
    ASSERT_TRUE(back.ok()) << back.error().to_string();
    EXPECT_EQ(back->kind, unit.kind);
    EXPECT_EQ(back->half, unit.half);
    EXPECT_EQ(back->begin, unit.begin);
    EXPECT_EQ(back->end, unit.end);
    message.set_end(message.begin());
    EXPECT_EQ(wire::from_proto(message).error().field, "unit.end");
  }
  v1::Unit message;
  wire::to_proto(Unit{Unit::Kind::bootstrap, 1, 0, 1}, message);
  EXPECT_EQ(wire::from_proto(message).error().field, "unit.half");
  wire::to_proto(Unit{Unit::Kind::bootstrap, 0, 0, chains::kMaxBootstrapSamples + 1}, message);
  EXPECT_EQ(wire::from_proto(message).error().field, "unit.end");
}

// Claim: plans round-trip, and each bad figure is refused by its name.
TEST(WireChains, Plans) {
  v1::ChainPlan message;
  wire::to_proto(ChainPlan{1000, 100000, 5000}, message);
  const auto back = wire::from_proto(message);
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->chains, 1000U);
  EXPECT_EQ(back->bootstrap_samples, 100000U);
  EXPECT_EQ(back->segment_mutations, 5000U);
  v1::ChainPlan bad = message;
  bad.set_chains(999);
  EXPECT_EQ(wire::from_proto(bad).error().field, "chains.chains");
  bad = message;
  bad.set_bootstrap_samples(0);
  EXPECT_EQ(wire::from_proto(bad).error().field, "chains.bootstrap_samples");
  bad = message;
  bad.set_segment_mutations(~0ULL);
  EXPECT_EQ(wire::from_proto(bad).error().field, "chains.segment_mutations");
}

// Claim: named state carries b0 to the last bit and no impossible one.
TEST(WireChains, NamedState) {
  v1::NamedState message;
  wire::to_proto(NamedState{3, 0.1}, message);
  EXPECT_EQ(wire::from_proto(message)->bootstrap_b, 0.1);
  for (const double bad : {-1.0, std::nan(""), HUGE_VAL}) {
    message.set_bootstrap_b(bad);
    EXPECT_EQ(wire::from_proto(message).error().field, "named_state.bootstrap_b");
  }
}

// Claim: a start is a sample before the first segment and a record after it; anything else is refused.
TEST(WireChains, Starts) {
  chains::ChainStart first;
  first.bootstrap_sample = 77;
  v1::ChainStart message;
  wire::to_proto(first, message);
  EXPECT_EQ(message.bootstrap_sample(), 77U);
  EXPECT_EQ(wire::from_proto(message)->bootstrap_sample, 77U);
  chains::ChainStart later;
  later.record.segments = 4;
  later.record.counts.mutations = 9;
  later.record.state = "state";
  wire::to_proto(later, message);
  const auto back = wire::from_proto(message);
  ASSERT_TRUE(back.ok()) << back.error().to_string();
  EXPECT_EQ(back->record, later.record);

  EXPECT_EQ(wire::from_proto(v1::ChainStart()).error().field, "chain_starts.start");
  message.set_record("nonsense");
  EXPECT_EQ(wire::from_proto(message).error().field, "chain_starts.chain_records");
  message.set_record(chains::encode(chains::ChainRecord()));
  EXPECT_EQ(wire::from_proto(message).error().field, "chain_starts.record");
  message.set_bootstrap_sample(chains::kMaxBootstrapSamples);
  EXPECT_EQ(wire::from_proto(message).error().field, "chain_starts.bootstrap_sample");
}

// Claim: figures for people survive the trip; a status of another number of groups is refused.
TEST(WireChains, Summaries) {
  chains::Summary summary;
  summary.normalisation = {0.25, 0.01, 1234};
  for (std::size_t i = 0; i < chains::kGroups; ++i)
    summary.groups[i] = {100 + i, 50, 30, 10, 0, 0, 7 * i, 0, 1.5F, 2.5F};
  v1::ChainStatus message;
  wire::to_proto(summary, message);
  const auto back = wire::from_proto(message);
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->normalisation.b, 0.25);
  EXPECT_EQ(back->normalisation.samples, 1234U);
  EXPECT_EQ(back->groups, summary.groups);
  message.add_groups();
  EXPECT_EQ(wire::from_proto(message).error().field, "chains.groups");
}

}  // namespace
}  // namespace candela
