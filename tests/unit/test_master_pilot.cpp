// Decisions of pilots: kept with the job, part of the state of its units, made anew if an older master
// kept nothing of it.
#include <gtest/gtest.h>

#include <string>

#include "master/truth/manifest.h"
#include "tests/unit/master_fixture.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master::pilots {
namespace {

const std::string kDecided("\0what\xff", 6);

class PilotOfAMaster : public MasterTest {
 protected:
  static v1::CompletePilotRequest result(const TestWorker& worker, const v1::Lease& lease) {
    v1::CompletePilotRequest request;
    worker.sign(request, lease);
    request.mutable_named_state()->set_film_scale_log2(20);
    request.mutable_named_state()->set_decided(kDecided);
    request.set_plan("the plan");
    request.set_seconds_per_iteration(0.5);
    return request;
  }
};

// Claim: every unit of a job has the bytes that its pilot decided, also after a restart between the pilot and
// the first unit. Nobody is shown them.
TEST_F(PilotOfAMaster, UnitsHaveWhatItDecided) {
  const std::string id = submit(40);
  {
    TestWorker worker(channel);
    ASSERT_TRUE(worker.enrol().ok());
    const auto pilot = worker.acquire();
    ASSERT_TRUE(pilot && pilot->unit().kind() == v1::Unit::KIND_PILOT);
    EXPECT_FALSE(pilot->has_named_state());
    ASSERT_TRUE(worker.complete(result(worker, *pilot)));
  }
  restart();
  EXPECT_EQ(show(id).named_state().decided(), "");
  TestWorker worker(channel);
  ASSERT_TRUE(worker.enrol().ok());
  std::size_t units = 0;
  while (const auto lease = worker.acquire()) {
    ASSERT_EQ(lease->unit().kind(), v1::Unit::KIND_ITERATIONS) << "a second pilot";
    EXPECT_EQ(lease->named_state().decided(), kDecided);
    EXPECT_EQ(lease->named_state().film_scale_log2(), 20);
    ASSERT_EQ(worker.deliver(*lease), v1::DELTA_VERDICT_MERGED);
    if (++units == 1) {  // and after one in between
      restart();
      worker = TestWorker(channel);
      ASSERT_TRUE(worker.enrol().ok());
    }
  }
  EXPECT_GE(units, 2U);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
}

// Claim: a pilot that decides more bytes than fit is refused by name, and the job waits for another.
TEST_F(PilotOfAMaster, TooManyBytesAreRefused) {
  submit(8);
  TestWorker worker(channel);
  ASSERT_TRUE(worker.enrol().ok());
  const auto pilot = worker.acquire();
  ASSERT_TRUE(pilot);
  v1::CompletePilotRequest request = result(worker, *pilot);
  request.mutable_named_state()->set_decided(std::string(Limits::max_decided_bytes + 1, 'x'));
  EXPECT_FALSE(worker.complete(request));
  EXPECT_EQ(worker.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(worker.status.error_message().find("named_state.decided"), std::string::npos);
  request.mutable_named_state()->set_decided(std::string(Limits::max_decided_bytes, 'x'));
  EXPECT_TRUE(worker.complete(request));
}

// Claim: a job's folder tells what its pilot decided; that of an older master tells that it does not.
TEST(PilotManifest, KeepsWhatWasDecided) {
  v1::Bundle bundle;
  bundle.set_main_path("scene.xml");
  v1::BundleFile& file = *bundle.add_files();
  file.set_path("scene.xml");
  file.set_sha256(sha256_hex("scene"));
  file.set_size_bytes(5);
  JobRow row;
  row.id = "j";
  row.settings.width = row.settings.height = 8;
  row.stop.iterations = 4;
  row.named_state = NamedState{7};
  for (const std::string& decided : {kDecided, std::string()}) {
    row.decided = decided;
    const auto bytes = encode_manifest(row, bundle.SerializeAsString(), {});
    ASSERT_TRUE(bytes.ok()) << bytes.error().to_string();
    const auto read = parse_manifest(*bytes);
    ASSERT_TRUE(read.ok()) << read.error().to_string();
    EXPECT_EQ(read->row.decided, decided);
    EXPECT_EQ(*read->row.named_state, *row.named_state);
    EXPECT_FALSE(read->row.pilot_outdated);
  }
  row.pilot_outdated = true;
  EXPECT_TRUE(parse_manifest(*encode_manifest(row, bundle.SerializeAsString(), {}))->row.pilot_outdated);
}

class OutdatedPilot : public SchedulerFixture {
 protected:
  // A job with four merged iterations, as a master left it that kept nothing of what the pilot decided.
  static JobRow old_row() {
    JobRow j = row("j", 40);
    j.state = JobState::running;
    j.named_state = NamedState{9};
    j.thread_seconds_per_iteration = 1;
    j.layers = {"direct"};
    j.audit.pilot_sha256 = "of the old pilot";
    j.audit.pilot_by = {"host/old"};
    j.audit.pilot_due = true;
    j.pilot_outdated = true;
    return j;
  }
  void restore(JobRow j) {
    HalfSets film;
    film[0].insert(0, 4);
    UnitRow merged, open;
    merged.id = 1;
    open.id = 2;
    merged.job_id = open.job_id = "j";
    merged.unit = {Unit::Kind::iterations, 0, 0, 4};
    merged.state = UnitRow::State::merged;
    open.unit = {Unit::Kind::iterations, 1, 0, 4};
    s->restore(std::move(j), film, {}, {open}, {merged}, now());
    expect_invariants();
  }
  static PilotResult result(std::vector<std::string> layers) {
    PilotResult result;
    result.state = NamedState{11, 0, kDecided};
    result.seconds_per_iteration = 1;
    result.work.layers = std::move(layers);
    return result;
  }
  // Renders what there is.
  std::uint64_t work() {
    std::uint64_t done = 0;
    while (const auto l = lease("a")) {
      const Unit unit = unit_of(*l);
      EXPECT_EQ(unit.kind, Unit::Kind::iterations);
      EXPECT_EQ(deliver(*l, unit, {}, 1), Delivery::ok);
      done += unit.end - unit.begin;
    }
    return done;
  }
};

// Claim: such a job has another pilot before any other unit, once. It keeps its film and the film's scale,
// and renders what it lacks, with what the new pilot decided.
TEST_F(OutdatedPilot, IsMadeAgain) {
  worker("a");
  restore(old_row());
  EXPECT_EQ(s->job("j")->row.iterations, 4U);
  const auto pilot = lease("a");
  ASSERT_TRUE(pilot);
  EXPECT_EQ(unit_of(*pilot).kind, Unit::Kind::pilot);
  EXPECT_FALSE(lease("a", true)) << "a unit without the pilot's decision";
  ASSERT_TRUE(s->complete_pilot("a", pilot->row.token, result({"direct"}), now()));
  expect_invariants();
  const JobRow& after = s->job("j")->row;
  EXPECT_EQ(after.decided, kDecided);
  EXPECT_FALSE(after.pilot_outdated);
  EXPECT_EQ(after.named_state->film_scale_log2, 9);
  EXPECT_EQ(work(), 36U);
  EXPECT_TRUE(s->job("j")->finishing);
}

// Claim: a job whose sums do not fit to the new build's plan ends with one sentence that says what to do.
TEST_F(OutdatedPilot, OfOtherSumsFails) {
  worker("a");
  restore(old_row());
  const auto pilot = lease("a");
  ASSERT_TRUE(pilot);
  EXPECT_TRUE(s->complete_pilot("a", pilot->row.token, result({"direct", "indirect"}), now()));
  expect_invariants();
  EXPECT_EQ(s->job("j")->row.state, JobState::failed);
  EXPECT_NE(s->job("j")->row.message.find("submit it again"), std::string::npos);
}

// Claim: an ended job has one when it is extended, not before, and a film that turns out to lack some then.
TEST_F(OutdatedPilot, OfAnEndedJobWaitsForItsExtension) {
  worker("a");
  JobRow j = old_row();
  j.state = JobState::done;
  j.stop.iterations = 4;
  restore(std::move(j));
  EXPECT_FALSE(lease("a"));
  ASSERT_TRUE(s->extend("j", 10, 0, 0, now()).ok());
  expect_invariants();
  const auto pilot = lease("a");
  ASSERT_TRUE(pilot);
  ASSERT_EQ(unit_of(*pilot).kind, Unit::Kind::pilot);
  s->reconcile("j", {}, {}, {}, 1, "", now());
  expect_invariants();
  const auto again = lease("a");
  ASSERT_TRUE(again);
  ASSERT_TRUE(s->complete_pilot("a", again->row.token, result({"direct"}), now()));
  EXPECT_EQ(work(), 14U);
}

}  // namespace
}  // namespace candela::master::pilots
