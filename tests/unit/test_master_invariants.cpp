// The scheduler's invariants: each notices its own violation, and what a film does behind the scheduler's
// back violates none.
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/unit/scheduler_fixture.h"

namespace candela::master {

class SchedulerPlants {
 public:
  explicit SchedulerPlants(Scheduler& scheduler) : s_(scheduler) {}
  Lease& lease() { return s_.leases_.begin()->second; }
  void move_lease() {
    auto node = s_.leases_.extract(s_.leases_.begin());
    node.key() = s_.next_token_ + 5;
    s_.leases_.insert(std::move(node));
  }
  void expire_late() { s_.none_expires_before_ = 1e9; }
  Job& job(const std::string& id) { return s_.jobs_.at(id); }
  UnitState& leased() { return job("j").units.at(lease().row.unit_id); }
  UnitState& open() {
    for (auto& [id, unit] : job("j").units)
      if (unit.leases.empty()) return unit;
    throw std::runtime_error("no open unit");
  }
  WorkerState& worker(const std::string& id) { return s_.workers_.at(id); }
  void withdraw() { s_.withdrawn_["gone"].node = s_.jobs_.extract("other"); }

 private:
  Scheduler& s_;
};

namespace {

class Invariants : public SchedulerFixture {
 protected:
  // Worker a has a unit of job j, one that it returned is open, one is merged; job other has only its pilot.
  void start() {
    s = std::make_unique<Scheduler>(options(), 1, 1);
    worker("a");
    worker("b");
    JobRow j = row("j", 100);
    j.named_state = NamedState{20};
    j.thread_seconds_per_iteration = 1;
    s->restore(j, {}, {}, {}, {}, now());
    JobRow other = row("other", 10);
    other.priority = -1;
    s->submit(other, now());
    const Lease first = *lease("a");
    deliver(first, unit_of(first), {}, 1);
    const Lease second = *lease("a");
    ASSERT_TRUE(lease("a"));
    s->return_lease("a", second.row.token, now());
  }
};

// Claim: each violation is noticed by the invariant of its name, and without one all hold.
TEST_F(Invariants, EachNoticesItsOwnViolation) {
  const std::vector<std::pair<std::string, std::function<void(SchedulerPlants&)>>> plants = {
      {"lease-key", [](auto& p) { p.move_lease(); }},
      {"lease-job", [](auto& p) { p.lease().row.job_id = "nobody"; }},
      {"lease-job", [](auto& p) { p.job("j").finishing = true; }},
      {"lease-unit", [](auto& p) { p.leased().leases.clear(); }},
      {"lease-unit", [](auto& p) { p.job("j").units.erase(p.lease().row.unit_id); }},
      {"lease-worker", [](auto& p) { p.worker("a").leases.clear(); }},
      {"lease-worker", [](auto& p) { p.lease().row.worker_id = "b"; }},
      {"lease-expiry", [](auto& p) { p.expire_late(); }},
      {"worker-key", [](auto& p) { p.worker("a").row.id = "b"; }},
      {"worker-lease", [](auto& p) { p.worker("b").leases.insert(p.lease().row.token); }},
      {"worker-lease", [](auto& p) { p.worker("a").leases.insert(7); }},
      {"distrusted", [](auto& p) { p.worker("b").distrusted = true; }},
      {"audit", [](auto& p) { p.job("j").rechecks = 1; }},
      {"audit", [](auto& p) { p.job("j").held.insert(p.leased().row.id); }},
      {"audit",
       [](auto& p) {
         p.open().audit.emplace();
         p.job("j").held.insert(p.open().row.id);
       }},
      {"audit",
       [](auto& p) {
         p.open().audit.emplace();
         p.open().audit->answers = {{"/a", "x", "x", 1}, {"/a", "y", "y", 1}};
         p.job("j").held.insert(p.open().row.id);
       }},
      {"audit-merged",
       [](auto& p) {
         p.open().audit.emplace();
         p.open().audit->recheck = true;
         p.job("j").rechecks = 1;
       }},
      {"doubtful",
       [](auto& p) {
         p.job("j").finishing = true;
         p.job("j").rechecks = 1;
       }},
      {"unit-key", [](auto& p) { p.open().row.id = 1000; }},
      {"unit-key", [](auto& p) { p.open().row.job_id = "other"; }},
      {"unit-lease", [](auto& p) { p.leased().leases.push_back(12345); }},
      {"unit-lease", [](auto& p) { p.leased().speculated = true; }},
      {"unit-state", [](auto& p) { p.open().row.state = UnitRow::State::leased; }},
      {"unit-state", [](auto& p) { p.leased().row.state = UnitRow::State::merged; }},
      {"unit-offered", [](auto& p) { p.job("j").maybe_open.clear(); }},
      {"unit-unmerged",
       [](auto& p) {
         const Unit& u = p.leased().row.unit;
         p.job("j").merged[u.half].insert(u.begin, u.end);
       }},
      {"unit-once", [](auto& p) { p.open().row.unit = p.leased().row.unit; }},
      {"unit-kind", [](auto& p) { p.open().row.unit.kind = Unit::Kind::segments; }},
      {"all-indices", [](auto& p) { p.job("j").units.erase(p.open().row.id); }},
      {"all-indices", [](auto& p) { p.job("j").source->put_back(p.open().row.unit); }},
      {"all-indices", [](auto& p) { p.job("other").source->cut(p.job("other").view(), 1); }},
      {"merged-count", [](auto& p) { ++p.job("j").row.iterations; }},
      {"job-key", [](auto& p) { p.job("j").row.id = "k"; }},
      {"job-key", [](auto& p) { p.job("other").row.named_state = NamedState{20}; }},
      {"job-ended", [](auto& p) { p.job("j").row.state = JobState::done; }},
      {"job-states",
       [](auto& p) {
         p.job("j").states.push_back({"j", 0, "radius", "00", 1});
       }},
      {"job-starts",
       [](auto& p) {
         p.job("j").row.chains = ChainPlan{};
         p.job("j").starts.resize(1);
       }},
      {"job-leases", [](auto& p) { ++p.job("j").leases; }},
      {"job-leases", [](auto& p) { p.job("j").under_way = 0; }},
      {"withdrawn", [](auto& p) { p.withdraw(); }},
  };
  for (std::size_t i = 0; i < plants.size(); ++i) {
    const auto& [name, plant] = plants[i];
    SCOPED_TRACE(name + ", plant " + std::to_string(i));
    start();
    ASSERT_TRUE(check_invariants(*s).empty());
    SchedulerPlants access(*s);
    plant(access);
    const std::vector<std::string> violations = check_invariants(*s);
    EXPECT_TRUE(std::any_of(violations.begin(), violations.end(), [&](const std::string& violation) {
      return violation.starts_with(name + ": ");
    })) << ::testing::PrintToString(violations);
  }
  start();
}

// Claim: a delta that a film takes while its job is cancelled and extended, so that its indices are in
// another unit by then, ends that unit: nobody renders it again, and the job ends.
TEST_F(Invariants, AFilmThatHasWhatWasCutAgain) {
  worker("a");
  worker("b");
  JobRow j = row("j", 40);
  j.named_state = NamedState{20};
  j.thread_seconds_per_iteration = 1;
  s->restore(j, {}, {}, {}, {}, now());
  const Lease first = *lease("a");
  const Unit unit = unit_of(first);
  deliver(first, unit, {}, 1);
  const Lease late = *lease("a");
  const Unit late_unit = unit_of(late);
  ASSERT_TRUE(s->cancel("j", now()).ok());
  ASSERT_TRUE(s->extend("j", 4, 0, 0, now()).ok());
  std::optional<Lease> again;
  for (int i = 0; i < 4; ++i) {  // one of them has the late unit's indices
    again = lease("b");
    ASSERT_TRUE(again);
    const Unit u = unit_of(*again);
    if (u.half == late_unit.half && u.begin <= late_unit.begin && late_unit.begin < u.end) break;
  }
  s->merged("a", late.row.token, late.row.unit_id, "j", late_unit, {}, 1, 0.001, now());
  expect_invariants();
  EXPECT_EQ(s->heartbeat("b", {again->row.token}, now()).revoked,
            std::vector<std::uint64_t>{again->row.token});
  std::array<film::IndexSet, 2> rendered;
  for (int i = 0; i < 100 && !s->job("j")->finishing; ++i) {
    at(clock + 1);
    const auto l = lease("a");
    if (!l) continue;
    const Unit u = unit_of(*l);
    EXPECT_FALSE(late_unit.half == u.half && u.begin < late_unit.end && late_unit.begin < u.end);
    deliver(*l, u, {}, 1);
    s->heartbeat("b", {}, now());
  }
  EXPECT_TRUE(s->job("j")->finishing);
}

}  // namespace
}  // namespace candela::master
