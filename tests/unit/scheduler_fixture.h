// The scheduler against a clock of the test's own. Its invariants are looked at after each lease and
// delivery, and at the end.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "master/scheduler/scheduler.h"
#include "tests/scheduler_invariants.h"

namespace candela::master {

class SchedulerFixture : public ::testing::Test {
 protected:
  static SchedulerOptions options() {
    SchedulerOptions o;
    o.lease_seconds = 10;
    o.unit_seconds = 4;
    return o;
  }
  void TearDown() override { expect_invariants(); }
  void expect_invariants() {
    for (const std::string& violation : check_invariants(*s)) ADD_FAILURE() << violation;
  }
  Now at(double t) {
    clock = t;
    return {t, static_cast<std::int64_t>(t * 1000)};
  }
  Now now() { return at(clock); }
  void worker(const std::string& id, std::vector<std::string> isas = {"avx2"}) {
    WorkerRow w;
    w.id = id;
    w.session = "session-" + id;
    w.name = id;
    w.isas = std::move(isas);
    ASSERT_TRUE(s->register_worker(w, now()).ok());
  }
  static JobRow row(const std::string& id, std::uint64_t iterations) {
    JobRow j;
    j.id = id;
    j.settings.width = 8;
    j.settings.height = 8;
    j.stop.iterations = iterations;
    j.bundle_sha256 = "bundle-" + id;
    return j;
  }
  std::optional<Lease> lease(const std::string& w, bool prefetch = false, bool full = false) {
    s->authenticate(w, "session-" + w, now());
    auto leased = s->acquire(w, {}, {prefetch, full}, now()).lease;
    expect_invariants();
    return leased;
  }
  Unit unit_of(const Lease& l) { return s->job(l.row.job_id)->units.at(l.row.unit_id).row.unit; }
  Delivery deliver(const Lease& l, const Unit& u, const film::SampleCounts& sample_counts, double seconds,
                   std::size_t record_bytes = 0) {
    const Delivery d = s->check_delivery(l.row.worker_id, l.row.token, l.row.unit_id, l.row.job_id, u, now());
    if (d == Delivery::ok)
      s->merged(l.row.worker_id, l.row.token, l.row.unit_id, l.row.job_id, u, sample_counts, seconds, 0.001,
                now(), record_bytes);
    expect_invariants();
    return d;
  }

  double clock = 100;
  std::unique_ptr<Scheduler> s = std::make_unique<Scheduler>(options(), 1, 1);
};

}  // namespace candela::master
