// Audits on a whole master in this process, with real deltas: whoever lies, the film of a job that is done is
// the one that honest workers make, to the bit.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "master/store/store.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

// A worker of a name of its own, that may deliver something else than the truth.
class NamedWorker : public TestWorker {
 public:
  // It makes this of a delta of `value` times the truth's light.
  using Lie = std::function<bool(const Unit&)>;
  NamedWorker(const std::shared_ptr<grpc::Channel>& channel, const std::string& who, Lie lie = {})
      : TestWorker(channel), lie_(std::move(lie)) {
    name = who;
    host = "host-" + who;
    EXPECT_TRUE(enrol().ok());
  }
  // One lease, done; the verdict, or nothing if there was none.
  std::optional<v1::DeltaVerdict> deliver_one() {
    const auto lease = acquire();
    if (!lease) return std::nullopt;
    if (lease->unit().kind() == v1::Unit::KIND_PILOT) {
      EXPECT_TRUE(pilot(*lease));
      return std::nullopt;
    }
    return send(*lease);
  }
  v1::DeltaVerdict send(const v1::Lease& lease) {
    const Unit unit = *wire::from_proto(lease.unit());
    const bool lies = lie_ && lie_(unit);
    const std::string bytes = lies ? false_delta(unit, lease.job_id()) : render(lease);
    lies_ += lies ? 1 : 0;
    v1::DeltaHeader h = header(lease, bytes);
    h.set_render_seconds(0.3 *
                         static_cast<double>(unit.end - unit.begin));  // a unit is about three iterations
    return push(h, bytes).verdict();
  }
  int lies() const { return lies_; }
  bool one_bit = false;  // lies are one bit, else black

 private:
  std::string false_delta(const Unit& unit, const std::string& job) const {
    return make_changed_delta(unit, job, 20, std::string(build_id()),
                              [&](std::uint64_t i, std::uint32_t x, std::uint32_t y, auto& color) {
                                if (!one_bit)
                                  color = {0, 0, 0};
                                else if (i == unit.begin && x == 7 && y == 9)
                                  color[1] += 0x1p-20F;
                              });
  }
  Lie lie_;
  int lies_ = 0;
};

class AuditedMaster : public MasterTest {
 protected:
  void start_with(double share) {
    audit_share = share;
    restart();
  }
  std::unique_ptr<NamedWorker> hand(const std::string& name, NamedWorker::Lie lie = {}) {
    return std::make_unique<NamedWorker>(channel, name, std::move(lie));
  }
  using Workers = std::vector<NamedWorker*>;
  // In turn, until the job has ended.
  void work(const std::string& id, const Workers& workers) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (show(id).state() < v1::JOB_STATE_DONE) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << show(id).ShortDebugString();
      bool any = false;
      for (NamedWorker* w : workers) any = w->deliver_one().has_value() || any;
      if (!any) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  void expect_true(const std::string& id, std::uint64_t iterations) {
    ASSERT_EQ(show(id).state(), v1::JOB_STATE_DONE);
    expect_same(checkpoint_of(id), expected_film(iterations));
    audit(id, iterations);
  }
  v1::ListWorkersResponse workers() {
    v1::ListWorkersResponse out;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListWorkers(&context, {}, &out).ok());
    return out;
  }
  grpc::Status distrust(const std::string& word) {
    v1::WorkerRequest request;
    request.set_worker_id(word);
    v1::TrustResponse out;
    grpc::ClientContext context;
    return farm->DistrustWorker(&context, request, &out);
  }
  grpc::Status trust(const std::string& word) {
    v1::WorkerRequest request;
    request.set_worker_id(word);
    v1::TrustResponse out;
    grpc::ClientContext context;
    return farm->TrustWorker(&context, request, &out);
  }
  std::size_t events(const std::string& job, const std::string& kind) {
    v1::ListEventsRequest request;
    request.set_job_id(job);
    v1::ListEventsResponse out;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListEvents(&context, request, &out).ok());
    return static_cast<std::size_t>(std::count_if(out.events().begin(), out.events().end(),
                                                  [&](const v1::Event& e) { return e.kind() == kind; }));
  }
  std::vector<v1::JobReport> verify(const std::string& id) {
    v1::VerifyJobsRequest request;
    request.set_job_id(id);
    grpc::ClientContext context;
    auto stream = farm->VerifyJobs(&context, request);
    std::vector<v1::JobReport> out;
    v1::JobReport report;
    while (stream->Read(&report)) out.push_back(report);
    EXPECT_TRUE(stream->Finish().ok());
    return out;
  }
};

// Claim: where all units are audited, one flipped bit of one unit is in no film: its worker is distrusted by
// name, its unit is rendered by others, and the film is the honest one. Honest workers alone give the same.
TEST_F(AuditedMaster, OneFlippedBit) {
  start_with(1);
  const auto a = hand("a"), b = hand("b"), c = hand("c");
  std::string id = submit(60);
  work(id, {a.get(), b.get(), c.get()});
  expect_true(id, 60);
  EXPECT_EQ(workers().distrusted_size(), 0);

  const auto bad = hand("bad", [n = 0](const Unit&) mutable { return ++n == 5; });
  bad->one_bit = true;
  id = submit(80);
  work(id, {bad.get(), a.get(), b.get(), c.get()});
  EXPECT_EQ(bad->lies(), 1);
  expect_true(id, 80);
  const v1::ListWorkersResponse all = workers();
  ASSERT_EQ(all.distrusted_size(), 1);
  EXPECT_EQ(all.distrusted(0).worker(), "host-bad/bad");
  EXPECT_NE(all.distrusted(0).reason().find(id), std::string::npos) << all.distrusted(0).reason();
  EXPECT_EQ(events("", "distrusted"), 1U);
  EXPECT_FALSE(bad->acquire());
}

// Claim: black units of a forger that were merged without an audit leave the film when the forger is found:
// the job begins anew by itself, says so, and ends as the honest film; its folder has no older checkpoint.
TEST_F(AuditedMaster, ALiarsSamplesLeaveTheFilm) {
  start_with(1e-9);
  const auto a = hand("a"), b = hand("b");
  bool always = false;
  const auto forger = hand("forger", [&](const Unit& unit) { return always || unit.begin >= 20; });
  const std::string id = submit(100);
  while (forger->lies() < 2) {
    ASSERT_LT(show(id).state(), v1::JOB_STATE_DONE);
    for (NamedWorker* w : Workers{a.get(), b.get(), forger.get()}) w->deliver_one();
  }
  ASSERT_TRUE(distrust(forger->session.worker_id()).ok());
  work(id, {a.get(), b.get(), forger.get()});
  expect_true(id, 100);
  EXPECT_EQ(events(id, "anew"), 1U);
  const int lies = forger->lies();
  // It is trusted again: its units are audited as those of a new worker.
  always = true;
  ASSERT_TRUE(trust("forger").ok());
  EXPECT_EQ(trust("forger").error_code(), grpc::StatusCode::NOT_FOUND);
  const std::string next = submit(100);
  work(next, {a.get(), b.get(), forger.get()});
  expect_true(next, 100);
  EXPECT_GT(forger->lies(), lies);
  EXPECT_EQ(workers().distrusted_size(), 1);
}

// Claim: honest samples of a worker that is distrusted stay, once others have borne them out.
TEST_F(AuditedMaster, WhatIsBorneOutStays) {
  start_with(1e-9);
  const auto a = hand("a"), b = hand("b"), suspect = hand("suspect");
  const std::string id = submit(100);
  while (show(id).units_merged() < 20) {
    ASSERT_LT(show(id).state(), v1::JOB_STATE_DONE);
    for (NamedWorker* w : Workers{a.get(), b.get(), suspect.get()}) w->deliver_one();
  }
  ASSERT_TRUE(distrust("host").error_code() == grpc::StatusCode::NOT_FOUND);
  ASSERT_TRUE(distrust(suspect->session.worker_id()).ok());
  work(id, {a.get(), b.get(), suspect.get()});
  expect_true(id, 100);
  EXPECT_EQ(events(id, "anew"), 0U);
  EXPECT_EQ(show(id).taints_size(), 0);
}

// Claim: a master that is restarted with a held unit renders it again, once; with a job that is to begin
// anew, it begins it anew; whom it distrusts is distrusted.
TEST_F(AuditedMaster, Restarts) {
  start_with(1);
  std::string id;
  {
    const auto a = hand("a"), b = hand("b");
    id = submit(40);
    while (!a->deliver_one()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_EQ(show(id).units_merged(), 0U) << "it is held";
    ASSERT_TRUE(distrust(b->session.worker_id()).ok());
  }
  restart();
  ASSERT_EQ(workers().distrusted_size(), 1);
  {
    const auto a = hand("a"), b = hand("b"), c = hand("c");
    EXPECT_FALSE(b->acquire());
    while (show(id).units_merged() < 5)
      for (NamedWorker* w : Workers{a.get(), c.get()}) w->deliver_one();
  }
  farm.reset();
  channel.reset();
  master.reset();
  {
    auto store = open_sqlite_store(folder.path() / "master.sqlite");
    ASSERT_TRUE(store.ok());
    auto state = (*store)->load();
    ASSERT_TRUE(state.ok());
    JobRow row = state->jobs.at(0);
    row.audit.anew = "a test says so";
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{row}}).ok());
  }
  start();
  const auto a = hand("a"), c = hand("c");
  work(id, {a.get(), c.get()});
  expect_true(id, 40);
  EXPECT_EQ(events(id, "anew"), 1U);
}

// Claim: an ended job tells who worked on it that is distrusted now, in its status and in verify; extending
// it looks at those units, and a false one has the job begin anew.
TEST_F(AuditedMaster, EndedJobsTell) {
  start_with(1e-9);
  const auto a = hand("a"), b = hand("b");
  const auto forger = hand("forger", [](const Unit& unit) { return unit.begin >= 20; });
  const std::string id = submit(100);
  work(id, {a.get(), b.get(), forger.get()});
  ASSERT_GT(forger->lies(), 0);
  ASSERT_EQ(workers().distrusted_size(), 0);
  EXPECT_TRUE(verify(id).at(0).findings().empty());
  ASSERT_TRUE(distrust(forger->session.worker_id()).ok());
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (show(id).taints_size() == 0 && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_EQ(show(id).taints_size(), 1);
  EXPECT_EQ(show(id).taints(0).worker(), "host-forger/forger");
  EXPECT_GT(show(id).taints(0).units(), 0U);
  EXPECT_NE(show(id).message().find("host-forger/forger"), std::string::npos);
  ASSERT_EQ(verify(id).at(0).findings_size(), 1);
  EXPECT_EQ(verify(id).at(0).findings(0).part(), "samples");
  restart();
  EXPECT_EQ(show(id).taints_size(), 1);

  v1::ExtendJobRequest more;
  more.set_job_id(id);
  more.set_add_iterations(20);
  v1::JobStatus status;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->ExtendJob(&context, more, &status).ok());
  const auto again = hand("a"), other = hand("b");
  work(id, {again.get(), other.get()});
  expect_true(id, 120);
  EXPECT_EQ(events(id, "anew"), 1U);
  EXPECT_EQ(show(id).taints_size(), 0);
}

// Claim: a worker that has left, and of which only the ledger tells, can be distrusted by its name, its host
// and name, or its old id, also after a restart of the master: its samples leave a job that has not ended,
// and one that has ended tells of it. A name of several hosts is refused with all of them, one of nobody is
// not found.
TEST_F(AuditedMaster, AWorkerThatHasLeftIsDistrusted) {
  start_with(1e-9);
  const auto a = hand("a"), b = hand("b");
  auto forger = hand("forger", [](const Unit& unit) { return unit.begin >= 20; });
  const std::string forger_id = forger->session.worker_id();
  const std::string ended = submit(100);
  work(ended, {a.get(), b.get(), forger.get()});
  const std::string open = submit(200);
  for (int i = 0; i < 2000 && show(open).iterations() < 100; ++i)
    for (NamedWorker* w : Workers{a.get(), b.get(), forger.get()}) w->deliver_one();
  ASSERT_GT(forger->lies(), 0);
  ASSERT_LT(show(open).state(), v1::JOB_STATE_DONE);
  {
    v1::DeregisterRequest leaving;
    leaving.set_worker_id(forger_id);
    leaving.set_session(forger->session.session());
    v1::DeregisterResponse gone;
    grpc::ClientContext context;
    ASSERT_TRUE(forger->stub->Deregister(&context, leaving, &gone).ok());
  }
  const v1::ListWorkersResponse present = workers();
  for (const v1::WorkerStatus& w : present.workers()) ASSERT_NE(w.name(), "forger") << "it is there";

  EXPECT_EQ(distrust("stranger").error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(distrust("orger").error_code(), grpc::StatusCode::NOT_FOUND);
  restart();
  for (const std::string& word : {forger_id, std::string("forger"), std::string("host-forger/forger")}) {
    SCOPED_TRACE(word);
    const grpc::Status done = distrust(word);
    ASSERT_TRUE(done.ok()) << done.error_message();
    ASSERT_EQ(workers().distrusted_size(), 1);
    EXPECT_EQ(workers().distrusted(0).worker(), "host-forger/forger");
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (show(ended).taints_size() == 0 && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    ASSERT_EQ(show(ended).taints_size(), 1);
    EXPECT_EQ(show(ended).taints(0).worker(), "host-forger/forger");
    EXPECT_GT(show(ended).taints(0).units(), 0U);
    if (word != "host-forger/forger") {
      ASSERT_TRUE(trust("forger").ok());
    }
  }
  const auto again = hand("a"), other = hand("b");
  work(open, {again.get(), other.get()});
  expect_true(open, 200);
  EXPECT_EQ(events(open, "anew"), 1U);

  const auto namesake = hand("a");  // of another host
  namesake->host = "host-z";
  ASSERT_TRUE(namesake->enrol().ok());
  EXPECT_EQ(distrust("a").error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

// Claim: an ended job of which samples are lost, and in which two workers had a part that are distrusted,
// says all of it, with the command that renders the lost ones again; so does the refusal of its image.
TEST_F(AuditedMaster, ALossIsSaidBesideFalseSamples) {
  start_with(1e-9);
  const auto a = hand("a"), b = hand("b");
  const std::string id = submit(60);
  work(id, {a.get(), b.get()});
  for (const NamedWorker* w : Workers{a.get(), b.get()}) ASSERT_TRUE(distrust(w->session.worker_id()).ok());
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (show(id).taints_size() < 2 && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  farm.reset();
  channel.reset();
  master.reset();
  for (const auto& file : std::filesystem::directory_iterator(folder.path() / "jobs" / id))
    if (file.path().filename().string().starts_with("film.")) std::filesystem::remove(file.path());
  start();
  v1::FetchImageRequest request;
  request.set_job_id(id);
  v1::FetchImageChunk chunk;
  grpc::ClientContext context;
  const auto stream = farm->FetchImage(&context, request);
  while (stream->Read(&chunk)) {
  }
  for (const std::string& text : {show(id).message(), stream->Finish().error_message()}) {
    EXPECT_NE(text.find("60 of 60 iterations are lost"), std::string::npos) << text;
    EXPECT_NE(text.find("`candela repair " + id + "`"), std::string::npos) << text;
    EXPECT_NE(text.find("host-a/a"), std::string::npos) << text;
    EXPECT_NE(text.find("host-b/b"), std::string::npos) << text;
  }
}

// Claim: a lease of an audit differs in nothing from another but its numbers, the pilot's included.
TEST_F(AuditedMaster, LeasesLookAlike) {
  start_with(1);
  const auto a = hand("a"), b = hand("b");
  const std::string id = submit(40);
  auto pilot = a->acquire();
  ASSERT_TRUE(pilot && pilot->unit().kind() == v1::Unit::KIND_PILOT);
  ASSERT_TRUE(a->pilot(*pilot));
  const auto again = b->acquire();
  ASSERT_TRUE(again && again->unit().kind() == v1::Unit::KIND_PILOT);
  const auto numberless = [](v1::Lease lease) {
    lease.clear_token();
    lease.clear_unit_id();
    lease.clear_expected_seconds();
    return lease.SerializeAsString();
  };
  EXPECT_EQ(numberless(*pilot), numberless(*again));
  ASSERT_TRUE(b->pilot(*again));
  const auto first = a->acquire();
  ASSERT_TRUE(first);
  EXPECT_EQ(a->send(*first), v1::DELTA_VERDICT_MERGED);
  const auto second = b->acquire();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->unit().begin(), first->unit().begin());
  EXPECT_EQ(numberless(*first), numberless(*second));
  EXPECT_EQ(b->send(*second), v1::DELTA_VERDICT_MERGED);
  EXPECT_EQ(show(id).units_merged(), 1U);
}

}  // namespace
}  // namespace candela::master
