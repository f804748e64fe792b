// A job's plan of work on the wire, and its bounds.
#include <gtest/gtest.h>

#include "common/wire/wire.h"

namespace candela {
namespace {

using film::AccumulatorSpec;

WorkPlan whole_plan() {
  WorkPlan plan;
  plan.layers = {"s2.t3", "independent"};
  plan.accumulators = {
      {"radius.sectors", 13, 12, AccumulatorSpec::Per::epoch},
      {"matrix", 64, -8, AccumulatorSpec::Per::job},
      {"light.visibility", 2, 0, AccumulatorSpec::Per::epoch, AccumulatorSpec::Domain::table, 3000},
      {"aov.mattes",
       1,
       36,
       AccumulatorSpec::Per::job,
       AccumulatorSpec::Domain::keys,
       0,
       {"cube", std::string("a\0\xff", 3)}}};
  plan.epochs = EpochPlan{8, 16, 1, "sectors", {{"alpha", "0.01"}, {"k", "0.7"}}};
  plan.development = DevelopmentPlan{"optimal_mis", {{"estimator", "crossfit"}}};
  return plan;
}

// Claim: a plan comes back as it was, with every part and without any.
TEST(WireWorkPlan, ComesBackAsItWas) {
  for (const bool chains : {false, true}) {
    WorkPlan plan = whole_plan();
    if (chains) {
      plan.development.reset();
      plan.chains = ChainPlan{100, 5000, 1U << 20};
    }
    v1::WorkPlan message;
    wire::to_proto(plan, message);
    const auto back = wire::from_proto(message);
    ASSERT_TRUE(back.ok()) << back.error().to_string();
    EXPECT_EQ(back->layers, plan.layers);
    EXPECT_EQ(back->accumulators, plan.accumulators);
    EXPECT_EQ(back->epochs, plan.epochs);
    EXPECT_EQ(back->development, plan.development);
    EXPECT_EQ(back->chains.has_value(), chains);
    if (chains) {
      EXPECT_EQ(back->chains->segment_mutations, plan.chains->segment_mutations);
    }
  }
  const auto empty = wire::from_proto(v1::WorkPlan());
  ASSERT_TRUE(empty.ok());
  EXPECT_TRUE(validate(*empty, 64, 64).ok());
  EXPECT_TRUE(validate(whole_plan(), 64, 64).ok());
}

// Claim: lists that are too long are refused before they are copied, each by its field.
TEST(WireWorkPlan, ListsAreBounded) {
  v1::WorkPlan message;
  for (int i = 0; i < 64; ++i) message.add_layers(std::to_string(i));
  EXPECT_EQ(wire::from_proto(message).error().field, "work.layers");
  message.clear_layers();
  for (std::uint32_t i = 0; i <= film::kMaxAccumulators; ++i) message.add_accumulators();
  EXPECT_EQ(wire::from_proto(message).error().field, "work.accumulators");
  message.Clear();
  message.add_accumulators()->set_domain(static_cast<v1::AccumulatorSpec::Domain>(3));
  EXPECT_EQ(wire::from_proto(message).error().field, "work.accumulators");
  message.Clear();
  message.mutable_chains()->set_chains(7);
  EXPECT_EQ(wire::from_proto(message).error().field.rfind("work.chains", 0), 0U);
}

// Claim: each part of a plan that cannot be is refused by its field.
TEST(WorkPlan, PartsAreChecked) {
  const auto field = [](void (*spoil)(WorkPlan&), std::uint32_t size = 64) -> std::string {
    WorkPlan plan = whole_plan();
    spoil(plan);
    const auto checked = validate(plan, size, size);
    return checked.ok() ? "valid" : checked.error().field;
  };
  EXPECT_EQ(field([](WorkPlan&) {}), "valid");
  EXPECT_EQ(field([](WorkPlan& p) { p.layers = {"a/b"}; }), "work.layers");
  EXPECT_EQ(field([](WorkPlan& p) { p.accumulators[0].channels = film::kMaxAccumulatorChannels + 1; }),
            "work.accumulators");
  EXPECT_EQ(field([](WorkPlan& p) { p.accumulators[3].per = AccumulatorSpec::Per::epoch; }),
            "work.accumulators");
  EXPECT_EQ(field([](WorkPlan& p) { p.accumulators[2].entries = 0; }), "work.accumulators");
  EXPECT_EQ(field([](WorkPlan& p) { p.accumulators[2].name = "statistics"; }), "valid") << "rules check it";
  EXPECT_EQ(field([](WorkPlan& p) { p.accumulators[2].name = "aov.statistics"; }), "work.accumulators")
      << "a domain that its readers do not know";
  EXPECT_EQ(field([](WorkPlan& p) { p.accumulators[3].name = "light.visibility"; }), "work.accumulators");
  EXPECT_EQ(field([](WorkPlan&) {}, 16384), "work.accumulators") << "too large together";
  EXPECT_EQ(field([](WorkPlan& p) { p.epochs->first = 0; }), "work.epochs.first");
  EXPECT_EQ(field([](WorkPlan& p) { p.epochs->first = 9; }), "work.epochs.first");
  EXPECT_EQ(field([](WorkPlan& p) { p.epochs->growth = 0; }), "work.epochs.growth");
  EXPECT_EQ(field([](WorkPlan& p) { p.epochs->lag = 65; }), "work.epochs.lag");
  EXPECT_EQ(field([](WorkPlan& p) { p.epochs->rule.clear(); }), "work.epochs.rule");
  EXPECT_EQ(field([](WorkPlan& p) { p.epochs->constants.emplace(std::string(), std::string("x")); }),
            "work.epochs.constants");
  EXPECT_EQ(field([](WorkPlan& p) { p.chains = ChainPlan{5, 10, 10}; }), "work.chains.chains");
}

// Claim: of all sets of parts those are valid of which each two go together, and the error of the others
// names the part that is wrong: chains need a second layer and have a read-out of their own, sums for each
// epoch need epochs. Chains and epochs go together.
TEST(WorkPlan, PairsOfPartsAreChecked) {
  for (unsigned parts = 0; parts < 32; ++parts) {
    const bool layers = parts & 1U, chains = parts & 2U, epochs = parts & 4U, development = parts & 8U,
               sums = parts & 16U;
    WorkPlan plan = whole_plan();
    if (!layers) plan.layers.clear();
    if (chains) plan.chains = ChainPlan{4, 10, 10};
    if (!epochs) plan.epochs.reset();
    if (!development) plan.development.reset();
    if (!sums) plan.accumulators = {plan.accumulators[1]};
    const std::string expected = chains && !layers       ? "work.layers"
                                 : chains && development ? "work.development"
                                 : sums && !epochs       ? "work.accumulators"
                                                         : "valid";
    const auto checked = validate(plan, 64, 64);
    EXPECT_EQ(checked.ok() ? "valid" : checked.error().field, expected) << parts;
  }
}

}  // namespace
}  // namespace candela
