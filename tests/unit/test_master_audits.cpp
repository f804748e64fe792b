// Audits by the scheduler alone: who lies is found and nobody else, and no false sample is in a film that is
// done. Farms of words (audit_simulation.h) run by seeds; the real bytes are test_master_audit_farm.cpp's.
#include <gtest/gtest.h>

#include "tests/unit/audit_simulation.h"

namespace candela::master {
namespace {

using Sim = AuditSimulation;

Sim::Lie always(const std::string& word) {
  return [word](const Unit& unit) { return word + " " + Sim::truth(unit); };
}

// Claim: audits of honest workers change nothing: every iteration is merged once, nobody is distrusted, and
// with a share of 1 every unit has two who brought it.
TEST(Audits, OfHonestWorkersChangeNothing) {
  for (const double share : {0.0, 0.01, 1.0})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(fmt::format("share {}, seed {}", share, seed));
      Sim sim(share, seed);
      for (const char* id : {"a", "b", "c"}) sim.worker(id);
      sim.submit("j", 300);
      sim.run("j");
      sim.expect_true("j", 300);
      EXPECT_TRUE(sim.distrusted().empty());
      EXPECT_EQ(sim.held_most > 0, share > 0);
      EXPECT_EQ(sim.s->audit_counts().disputes, 0U);
      for (const auto& [id, row] : sim.rows) {
        if (share == 1 || share == 0) {
          EXPECT_EQ(row.by.size(), share == 1 ? 2U : 1U) << id;
        }
        EXPECT_EQ(row.sha256, "bytes " + Sim::truth(row.unit));
      }
    }
}

// Claim: the choice is a pure function with about its share of all units, and differs with the secret and the
// job; where a unit ends does not matter.
TEST(Audits, ChooseTheirShareByASecret) {
  int chosen = 0, other_secret = 0, other_job = 0;
  constexpr int kUnits = 20000;
  for (std::uint64_t i = 0; i < kUnits; ++i) {
    const Unit unit{Unit::Kind::iterations, static_cast<std::uint32_t>(i % 2), i, i + 5};
    const Unit shorter{Unit::Kind::iterations, static_cast<std::uint32_t>(i % 2), i, i + 1};
    const bool is = is_audited(7, "j", unit, 0.01);
    EXPECT_EQ(is, is_audited(7, "j", shorter, 0.01));
    EXPECT_TRUE(is_audited(7, "j", unit, 1));
    EXPECT_FALSE(is_audited(7, "j", unit, 0));
    chosen += is ? 1 : 0;
    other_secret += is && is_audited(8, "j", unit, 0.01) ? 1 : 0;
    other_job += is && is_audited(7, "k", unit, 0.01) ? 1 : 0;
  }
  EXPECT_GT(chosen, 140);  // 200 expected, with a standard deviation of 14
  EXPECT_LT(chosen, 260);
  EXPECT_LT(other_secret, 15);
  EXPECT_LT(other_job, 15);
}

// Claim: one flipped bit in one unit is found where all units are audited; it is never merged, and nothing
// that the worker brought before is lost, since others bear it out.
TEST(Audits, FindOneFlippedBit) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Sim sim(1, seed);
    bool flipped = false;
    sim.worker("a");
    sim.worker("b", [&, left = 10](const Unit& unit) mutable {
      if (--left != 0) return std::string();
      flipped = true;
      return "flipped " + Sim::truth(unit);
    });
    sim.worker("c");
    sim.submit("j", 400);
    sim.run("j");
    ASSERT_TRUE(flipped);
    sim.expect_true("j", 400);
    EXPECT_EQ(sim.distrusted(), std::set<std::string>{"b"});
    EXPECT_EQ(sim.events_of("anew"), 0U);
    EXPECT_GT(sim.s->audit_counts().rechecked, 0U);
    EXPECT_TRUE(sim.job("j").row.audit.taints.empty());
    for (const auto& [id, row] : sim.rows)
      EXPECT_EQ(std::count(row.by.begin(), row.by.end(), "host-b/b"), 0) << id;
  }
}

// Claim: with a share of 1 %, a bit that is flipped in a unit that is among them is found.
TEST(Audits, FindAFlippedBitInTheirShare) {
  bool flipped = false;
  for (std::uint64_t secret = 1; !flipped && secret < 100; ++secret) {
    Sim sim(0.01, secret, secret);
    const auto lie = [&](const Unit& unit) {
      if (!is_audited(secret, "j", unit, 0.01) || flipped || unit.begin < 100) return std::string();
      flipped = true;
      return std::string("flipped");
    };
    sim.worker("a");
    sim.worker("b", lie);
    sim.worker("c");
    sim.submit("j", 2000);
    sim.run("j", 20000);
    sim.expect_true("j", 2000);
    EXPECT_EQ(sim.distrusted(), flipped ? std::set<std::string>{"b"} : std::set<std::string>());
  }
  EXPECT_TRUE(flipped) << "nothing is tested";
}

// Claim: of a liar whose lies were merged before it was found out no sample stays: the job begins anew, says
// so, and ends true. Its first units are true, so that no audit of a new worker finds it.
TEST(Audits, LeaveNoSampleOfALiar) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Sim sim(0.05, seed);
    int lies = 0;
    sim.worker("a");
    sim.worker("b", [&, told = 0](const Unit& unit) mutable {
      if (++told <= 12) return std::string();
      ++lies;
      return "black " + Sim::truth(unit);
    });
    sim.worker("c");
    sim.worker("d");
    sim.submit("j", 3000);
    sim.run("j", 20000);
    ASSERT_GT(lies, 1);
    sim.expect_true("j", 3000);
    EXPECT_EQ(sim.distrusted(), std::set<std::string>{"b"});
    EXPECT_EQ(sim.events_of("anew"), 1U);
    EXPECT_EQ(sim.s->audit_counts().anew, 1U);
  }
}

// Claim: a forger is found by its first units whatever the share, with nothing of it merged.
TEST(Audits, FindAForgerByItsFirstUnits) {
  Sim sim(1e-9);
  sim.worker("a");
  sim.worker("b");
  sim.worker("forger", always("black"));
  sim.submit("j", 400);
  sim.run("j");
  sim.expect_true("j", 400);
  EXPECT_EQ(sim.distrusted(), std::set<std::string>{"forger"});
  EXPECT_EQ(sim.events_of("anew"), 0U);
}

// Claim: two who always collude lose against three, whichever pairs meet first, and no sample of theirs
// stays.
TEST(Audits, TwoWhoColludeLoseAgainstThree) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    Sim sim(1, seed);
    for (const char* id : {"a", "b", "c"}) sim.worker(id);
    for (const char* id : {"x", "y"}) sim.worker(id, always("false"));
    sim.submit("j", 500);
    sim.run("j", 10000);
    sim.expect_true("j", 500);
    EXPECT_EQ(sim.distrusted(), (std::set<std::string>{"x", "y"}));
  }
}

// Claim: they lose also where both answer a disputed unit before any third honest worker.
TEST(Audits, AMajorityIsOfAllWhoCouldAnswer) {
  Audit audit;
  audit.answers = {{"h/x", "f", "f"}, {"h/y", "f", "f"}, {"h/a", "t", "t"}};
  EXPECT_TRUE(audit.disputed());
  EXPECT_EQ(audit.majority({"h/a", "h/b", "h/c", "h/x", "h/y"}), "");
  EXPECT_EQ(audit.majority({"h/a", "h/x", "h/y"}), "f");
  audit.answers.push_back({"h/b", "t", "t"});
  EXPECT_EQ(audit.majority({"h/a", "h/b", "h/c", "h/x", "h/y"}), "");
  audit.answers.push_back({"h/c", "t", "t"});
  EXPECT_EQ(audit.majority({"h/a", "h/b", "h/c", "h/x", "h/y"}), "t");
  std::set<std::string> many;
  for (int i = 0; i < 1000; ++i) many.insert(fmt::format("h/{}", i));
  EXPECT_EQ(audit.majority(many), "") << "three of a thousand";
  audit.answers.push_back({"h/d", "t", "t"});
  audit.answers.push_back({"h/e", "t", "t"});
  EXPECT_EQ(audit.majority(many), "t");
}

// Claim: a worker alone is not audited and not held up; two go on with one when the other goes away in the
// middle of an audit; a held unit is another host's for a while.
TEST(Audits, NeverHoldUpAFarm) {
  {
    Sim sim(1);
    sim.worker("a");
    sim.submit("j", 200);
    sim.run("j");
    sim.expect_true("j", 200);
    EXPECT_GT(sim.s->audit_counts().alone, 0U);
  }
  {
    Sim sim(1);
    sim.worker("a");
    sim.worker("b");
    sim.submit("j", 400);
    while (sim.job("j").held.empty()) sim.step();
    sim.workers.at("b").away = true;
    sim.run("j");
    sim.expect_true("j", 400);
    EXPECT_TRUE(sim.distrusted().empty());
  }
  Sim sim(1);
  sim.worker("a", {}, "one");
  sim.worker("b", {}, "one");
  sim.worker("c", {}, "two");
  sim.submit("j", 300);
  sim.run("j");
  sim.expect_true("j", 300);
  std::size_t across = 0;
  for (const auto& [id, row] : sim.rows)
    across += row.by.size() == 2 && host_of(row.by[0]) != host_of(row.by[1]) ? 1 : 0;
  EXPECT_GT(across, sim.rows.size() / 2);
}

// Claim: two workers that differ and have no third are asked again: one that then says something else was
// wrong. If both stay with their word nothing of the unit is merged, the message says what is to be done, and
// a third worker, or an operator's word, decides.
TEST(Audits, OfTwoThatDifferAThirdDecides) {
  {
    Sim sim(1);
    bool once = false;
    sim.worker("a");
    sim.worker("b", [&](const Unit&) { return std::exchange(once, true) ? std::string() : "a cosmic ray"; });
    sim.submit("j", 200);
    sim.run("j");
    sim.expect_true("j", 200);
    EXPECT_EQ(sim.distrusted(), std::set<std::string>{"b"});
  }
  for (const bool operator_decides : {false, true}) {
    Sim sim(1);
    sim.worker("a");
    sim.worker("b", always("false"));
    sim.submit("j", 200);
    sim.run("j", 200);
    ASSERT_FALSE(sim.ended("j"));
    EXPECT_TRUE(sim.films["j"].empty());
    EXPECT_NE(sim.s->message_of(sim.job("j"), sim.now()).find("candela workers distrust"), std::string::npos);
    if (operator_decides)
      ASSERT_TRUE(sim.s->distrust("b", sim.now()).ok());
    else
      sim.worker("c");
    sim.run("j");
    sim.expect_true("j", 200);
    EXPECT_EQ(sim.distrusted(), std::set<std::string>{"b"});
  }
}

// Claim: a unit that is cut short is audited as what was delivered of it, and the rest is rendered by others.
TEST(Audits, CompareUnitsThatWereCut) {
  Sim sim(1);
  for (const char* id : {"a", "b"}) sim.worker(id);
  sim.submit("j", 400);
  for (int i = 0; i < 100; ++i) sim.step();
  for (int round = 0; round < 5 && !sim.ended("j"); ++round) {
    ASSERT_TRUE(sim.s->pause_worker("a", sim.now()).ok());
    for (int i = 0; i < 15; ++i) sim.step();
    ASSERT_TRUE(sim.s->resume_worker("a", sim.now()).ok());
    for (int i = 0; i < 30; ++i) sim.step();
  }
  sim.run("j");
  sim.expect_true("j", 400);
  EXPECT_TRUE(sim.distrusted().empty());
}

// Claim: over restarts of the master held units are rendered again, a distrusted worker stays so, and one
// that registers anew under its name, too; the film is true.
TEST(Audits, OutliveTheMaster) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    Sim sim(0.2, seed);
    for (const char* id : {"a", "b", "c"}) sim.worker(id);
    sim.worker("x", [told = 0](const Unit& unit) mutable {
      return ++told <= 8 ? std::string() : "false " + Sim::truth(unit);
    });
    sim.submit("j", 1500);
    bool found = false;
    for (int round = 0; round < 12 && !sim.ended("j"); ++round) {
      for (int i = 0; i < 60 && !sim.ended("j"); ++i) sim.step();
      const bool held = !sim.job("j").held.empty();
      sim.restart();
      EXPECT_TRUE(sim.job("j").held.empty()) << held;
      if (found) {
        EXPECT_TRUE(sim.distrusts("x"));
      }
      found = sim.distrusts("x");
    }
    sim.run("j", 5000);
    EXPECT_TRUE(sim.distrusts("x"));
    sim.expect_true("j", 1500);
  }
}

// Claim: a job that is cancelled with held units ends at once; paused, it holds nothing up and goes on later.
TEST(Audits, OfJobsThatStop) {
  Sim sim(1);
  for (const char* id : {"a", "b"}) sim.worker(id);
  for (const char* id : {"j", "k"}) {
    sim.submit(id, 300);
    while (sim.job(id).held.empty()) sim.step();
    if (id == std::string("j")) {
      ASSERT_TRUE(sim.s->cancel("j", sim.now()).ok());
      for (int i = 0; i < 50; ++i) sim.step();
      EXPECT_EQ(sim.job("j").row.state, JobState::cancelled);
    } else {
      ASSERT_TRUE(sim.s->pause("k", sim.now()).ok());
      for (int i = 0; i < 300; ++i) sim.step();
      ASSERT_TRUE(sim.s->resume("k", sim.now()).ok());
      sim.run("k");
      sim.expect_true("k", 300);
    }
  }
}

// Claim: a false pilot of a new worker is found, its worker distrusted, and the job begun anew with
// another's; an honest one costs the job no delay.
TEST(Audits, FindAFalsePilot) {
  Sim sim(0.01);
  sim.worker("liar");
  sim.workers.at("liar").pilot_scale = 13;
  sim.submit("j", 300);
  while (!sim.job("j").planned()) sim.step();
  EXPECT_EQ(sim.job("j").row.named_state->film_scale_log2, 13);
  sim.worker("a");
  sim.worker("b");
  sim.run("j");
  // Nobody was there to compare it; the next job has others.
  sim.submit("k", 300);
  sim.run("k");
  sim.expect_true("k", 300);
  EXPECT_EQ(sim.job("k").row.named_state->film_scale_log2, 20);

  Sim together(0.01);
  together.worker("liar");
  together.workers.at("liar").pilot_scale = 13;
  for (const char* id : {"a", "b"}) together.worker(id);
  for (const char* id : {"j", "k", "l"}) together.submit(id, 200);
  for (const char* id : {"j", "k", "l"}) {
    together.run(id);
    together.expect_true(id, 200);
    EXPECT_EQ(together.job(id).row.named_state->film_scale_log2, 20);
  }
}

// Claim: so is a pilot that is false in nothing but what it decided.
TEST(Audits, FindAFalseDecision) {
  Sim sim(0.01);
  sim.worker("liar");
  sim.workers.at("liar").decided = "a lie";
  for (const char* id : {"a", "b"}) sim.worker(id);
  for (const char* id : {"j", "k", "l"}) sim.submit(id, 200);
  for (const char* id : {"j", "k", "l"}) {
    sim.run(id);
    sim.expect_true(id, 200);
    EXPECT_EQ(sim.job(id).row.decided, "the truth");
  }
  EXPECT_TRUE(sim.distrusts("liar"));
}

// Claim: an ended job that a liar worked on says so, with the number of its units; to extend it looks at them
// again, and begins anew if they were false; to trust the worker takes the words back.
TEST(Audits, TaintJobsThatHaveEnded) {
  for (const bool lied_before : {false, true}) {
    SCOPED_TRACE(lied_before);
    Sim sim(1e-9);
    for (const char* id : {"a", "b"}) sim.worker(id);
    sim.worker("x", [&](const Unit& unit) {
      return lied_before && unit.begin >= 200 ? "false " + Sim::truth(unit) : std::string();
    });
    sim.submit("j", 600);
    sim.run("j");
    ASSERT_EQ(sim.job("j").row.state, JobState::done);
    ASSERT_TRUE(sim.distrusted().empty());
    ASSERT_TRUE(sim.s->distrust("x", sim.now()).ok());
    sim.step();
    ASSERT_EQ(sim.job("j").row.audit.taints.size(), 1U);
    const Taint taint = sim.job("j").row.audit.taints[0];
    EXPECT_EQ(taint.worker, "host-x/x");
    std::uint64_t units = 0;
    for (const auto& [id, row] : sim.rows) units += std::count(row.by.begin(), row.by.end(), taint.worker);
    EXPECT_EQ(taint.units, units);
    EXPECT_NE(sim.s->message_of(sim.job("j"), sim.now()).find("host-x/x"), std::string::npos);

    ASSERT_TRUE(sim.s->trust("x", sim.now()).ok());
    EXPECT_TRUE(sim.job("j").row.audit.taints.empty());
    EXPECT_FALSE(sim.s->trust("x", sim.now()).ok());
    ASSERT_TRUE(sim.s->distrust("x", sim.now()).ok());
    sim.step();
    EXPECT_EQ(sim.job("j").row.audit.taints.size(), 1U);

    ASSERT_TRUE(sim.s->extend("j", 100, 0, 0, sim.now()).ok());
    sim.run("j");
    sim.expect_true("j", 700);
    EXPECT_EQ(sim.events_of("anew"), lied_before ? 1U : 0U);
    EXPECT_TRUE(sim.job("j").row.audit.taints.empty());
  }
}

// Claim: a liar that is found while a job writes its last checkpoint keeps the job from ending before its
// units are looked at; a job of epochs or chains that it worked on begins anew.
TEST(Audits, LookAtAJobThatIsAboutToEnd) {
  Sim sim(1e-9);
  for (const char* id : {"a", "b", "x"}) sim.worker(id);
  sim.submit("j", 300);
  while (!sim.job("j").finishing) {
    sim.step();
    if (sim.ended("j")) break;
  }
  if (!sim.ended("j")) {
    ASSERT_TRUE(sim.s->distrust("x", sim.now()).ok());
  }
  sim.run("j");
  sim.expect_true("j", 300);

  Sim epochs(1e-9);
  for (const char* id : {"a", "b", "x"}) epochs.worker(id);
  WorkPlan plan;
  plan.epochs = EpochPlan{1000, 16, 1, "rule", {}};
  epochs.submit("j", 400, plan);
  while (!epochs.job("j").row.epochs) epochs.step();
  epochs.s->decided({"j", 0, "rule", std::string(64, 'a'), 1}, epochs.now());
  while (epochs.films["j"].size() < 200) epochs.step();
  ASSERT_TRUE(epochs.s->distrust("x", epochs.now()).ok());
  epochs.step();
  epochs.step();
  EXPECT_EQ(epochs.events_of("anew"), 1U);
  while (!epochs.job("j").row.epochs) epochs.step();
  epochs.s->decided({"j", 0, "rule", std::string(64, 'a'), 1}, epochs.now());
  epochs.run("j");
  epochs.expect_true("j", 400);
}

// Claim: a worker of this name on this host is distrusted, also if its program starts again or comes back
// later, until somebody trusts it.
TEST(Audits, DistrustNamesNotProcesses) {
  Sim sim(0.01);
  sim.worker("a");
  sim.worker("x");
  ASSERT_TRUE(sim.s->distrust("x", sim.now()).ok());
  sim.s->deregister("x", sim.now());
  sim.enrol(sim.workers.at("x"));
  sim.submit("j", 100);
  sim.run("j");
  sim.expect_true("j", 100);
  EXPECT_EQ(sim.workers.at("x").leases, 0U);
  EXPECT_EQ(sim.s->worker_state_name(sim.s->workers().at("x"), sim.now()), "distrusted");
  const auto back = sim.s->trust("host-x/x", sim.now());
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->worker, "host-x/x");
  EXPECT_EQ(sim.s->worker_state_name(sim.s->workers().at("x"), sim.now()), "idle");
  EXPECT_FALSE(sim.s->trust("nobody", sim.now()).ok());
  EXPECT_FALSE(sim.s->distrust("nobody", sim.now()).ok());
}

// Claim: a liar that left is distrusted by what the ledger tells of it, long after: its samples leave a job
// that has not ended, and a job that has ended says that it had a part. One that left with its only answer to
// an audit is known by that.
TEST(Audits, DistrustAWorkerThatHasLeft) {
  Sim sim(1e-9);
  for (const char* id : {"a", "b"}) sim.worker(id);
  sim.worker(
      "x", [](const Unit& unit) { return unit.begin >= 200 ? "false " + Sim::truth(unit) : std::string(); });
  sim.submit("ended", 600);
  sim.run("ended");
  sim.submit("open", 900);
  while (sim.films["open"].size() < 600) sim.step();
  sim.s->deregister("x", sim.now());
  sim.workers.erase("x");
  for (int i = 0; i < 20; ++i) sim.step();
  ASSERT_FALSE(sim.ended("open"));

  std::vector<MakerRow> makers;
  for (const auto& [id, row] : sim.rows)
    if (!row.by.empty()) makers.push_back({row.worker_id, row.by});
  EXPECT_FALSE(sim.s->distrust("z", sim.now(), makers).ok());
  const auto row = sim.s->distrust("host-x/x", sim.now(), makers);
  ASSERT_TRUE(row.ok()) << row.error().to_string();
  EXPECT_EQ(row->worker, "host-x/x");
  sim.step();
  ASSERT_EQ(sim.job("ended").row.audit.taints.size(), 1U);
  EXPECT_GT(sim.job("ended").row.audit.taints[0].units, 0U);
  sim.run("open");
  sim.expect_true("open", 900);
  EXPECT_EQ(sim.events_of("anew"), 1U);

  Sim audited(1);
  for (const char* id : {"a", "x"}) audited.worker(id);
  audited.submit("j", 300);
  while (audited.job("j").held.empty()) audited.step();
  const auto held = *audited.job("j").held.begin();
  const std::string who = audited.job("j").units.at(held).audit->answers.at(0).worker;
  const std::string name = who.substr(who.find('/') + 1);
  audited.s->deregister(name, audited.now());
  audited.workers.erase(name);
  ASSERT_TRUE(audited.s->distrust(name, audited.now()).ok());
  audited.run("j");
  audited.expect_true("j", 300);
}

}  // namespace
}  // namespace candela::master
