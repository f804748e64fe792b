// Jobs whose files are damaged or gone (master/truth): what is lost is said, rendered again when asked, and
// never counted as there.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <ostream>

#include "master/farm.h"
#include "master/scheduler/index_sets.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

// The harm done to the files of a job while the master is down.
enum class Harm : std::uint8_t { flip_newest, remove_newest, flip_all, remove_all };

std::string name_of(Harm harm) {
  switch (harm) {
    case Harm::flip_newest:
      return "FlipNewest";
    case Harm::remove_newest:
      return "RemoveNewest";
    case Harm::flip_all:
      return "FlipAll";
    case Harm::remove_all:
      return "RemoveAll";
  }
  return "";
}

void flip_middle(const fs::path& path) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const auto at = static_cast<std::streamoff>(fs::file_size(path) / 2);
  file.seekg(at);
  const int byte = file.get();
  file.seekp(at);
  file.put(static_cast<char>(byte ^ 1));
}

class TruthTest : public MasterTest {
 protected:
  fs::path job_folder(const std::string& id) { return folder.path() / "jobs" / id; }
  // Newest first.
  std::vector<fs::path> checkpoints(const std::string& id) {
    std::vector<std::pair<std::uint64_t, fs::path>> found;
    for (const auto& entry : fs::directory_iterator(job_folder(id)))
      if (const std::string n = entry.path().filename().string();
          n.starts_with("film.") && n.ends_with(".ckpt"))
        found.emplace_back(std::stoull(n.substr(5)), entry.path());
    std::sort(found.rbegin(), found.rend());
    std::vector<fs::path> out;
    for (auto& [generation, path] : found) out.push_back(std::move(path));
    return out;
  }
  void harm(const std::string& id, Harm harm) {
    for (const fs::path& path : checkpoints(id)) {
      if (harm == Harm::flip_newest || harm == Harm::flip_all)
        flip_middle(path);
      else
        fs::remove(path);
      if (harm == Harm::flip_newest || harm == Harm::remove_newest) return;
    }
  }
  void stop_master() {
    farm.reset();
    channel.reset();
    master.reset();
  }
  // Renders until so many iterations are merged, and waits for a checkpoint between units, so that there are
  // several generations with different contents.
  void render(const std::string& id, std::uint64_t iterations) {
    TestWorker worker(channel);
    ASSERT_TRUE(worker.enrol().ok());
    for (int i = 0; i < 1000 && show(id).iterations() < iterations && show(id).state() < v1::JOB_STATE_DONE;
         ++i) {
      const std::uint64_t before = show(id).checkpoint_generation();
      if (worker.step() && show(id).iterations() > 0)
        wait_until(id, [&](const v1::JobStatus& s) { return s.checkpoint_generation() > before; });
    }
  }
  template <class Condition>
  v1::JobStatus wait_until(const std::string& id, Condition condition) {
    v1::JobStatus status = show(id);
    for (int i = 0; i < 5000 && !condition(status); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      status = show(id);
    }
    EXPECT_TRUE(condition(status)) << status.ShortDebugString();
    return status;
  }
  std::string done_job(std::uint64_t iterations) {
    const std::string id = submit(iterations);
    render(id, iterations);
    EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
    return id;
  }
  grpc::Status try_fetch(const std::string& id, bool partial) {
    v1::FetchImageRequest request;
    request.set_job_id(id);
    request.set_partial(partial);
    grpc::ClientContext context;
    auto stream = farm->FetchImage(&context, request);
    v1::FetchImageChunk chunk;
    while (stream->Read(&chunk)) {
    }
    return stream->Finish();
  }
  std::pair<grpc::Status, v1::JobStatus> repair(const std::string& id) {
    v1::JobRequest request;
    request.set_job_id(id);
    grpc::ClientContext context;
    std::pair<grpc::Status, v1::JobStatus> out;
    out.first = farm->RepairJob(&context, request, &out.second);
    return out;
  }
  std::vector<v1::JobReport> verify(const std::string& id = "") {
    v1::VerifyJobsRequest request;
    request.set_job_id(id);
    grpc::ClientContext context;
    auto stream = farm->VerifyJobs(&context, request);
    std::vector<v1::JobReport> out;
    for (v1::JobReport report; stream->Read(&report);) out.push_back(report);
    const grpc::Status status = stream->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return out;
  }
  std::vector<std::string> event_kinds(const std::string& id) {
    v1::ListEventsRequest request;
    request.set_job_id(id);
    v1::ListEventsResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListEvents(&context, request, &response).ok());
    std::vector<std::string> out;
    for (const v1::Event& e : response.events()) out.push_back(e.kind());
    return out;
  }
  bool happened(const std::string& id, const std::string& kind) {
    const auto kinds = event_kinds(id);
    return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
  }
  // Rows and film are one set, whatever that is.
  void expect_ledger_is_film(const std::string& id) {
    const v1::GetLedgerResponse ledger = test::ledger(*farm, id);
    HalfSets rows, film;
    for (const auto& r : ledger.merged())
      EXPECT_TRUE(rows[r.unit().half()].insert(r.unit().begin(), r.unit().end()));
    for (const auto& r : ledger.film()) EXPECT_TRUE(film[r.half()].insert(r.begin(), r.end()));
    EXPECT_EQ(rows, film);
    EXPECT_EQ(count(film), show(id).iterations());
  }
};

void PrintTo(Harm harm, std::ostream* out) {
  *out << name_of(harm);
}

class EndedTruth : public TruthTest, public testing::WithParamInterface<Harm> {};

// Claim: an ended job whose checkpoints are damaged or gone says how much it has lost, gives no image as if
// it were whole, keeps its ledger equal to its film, and after `repair` has the very film it had.
TEST_P(EndedTruth, SaysWhatIsLostAndRendersItAgain) {
  const std::string id = done_job(9);
  stop_master();
  ASSERT_GE(checkpoints(id).size(), 2U);
  harm(id, GetParam());
  start();
  const v1::JobStatus hurt = wait_until(id, [](const v1::JobStatus& s) { return s.lost() > 0; });
  EXPECT_EQ(hurt.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(hurt.iterations() + hurt.lost(), 9U);
  EXPECT_NE(hurt.message().find("candela repair " + id), std::string::npos) << hurt.message();
  EXPECT_TRUE(happened(id, "lost"));
  EXPECT_EQ(happened(id, "checkpoint-damaged"),
            GetParam() == Harm::flip_newest || GetParam() == Harm::flip_all);
  EXPECT_EQ(try_fetch(id, false).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  if (hurt.iterations() > 0) {
    EXPECT_TRUE(try_fetch(id, true).ok());
  }
  expect_ledger_is_film(id);

  restart();  // what is lost is remembered
  EXPECT_EQ(wait_until(id, [](const v1::JobStatus& s) { return s.lost() > 0; }).lost(), hurt.lost());

  const auto [status, queued] = repair(id);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(queued.repairing());
  EXPECT_EQ(queued.state(), v1::JOB_STATE_QUEUED);
  render(id, 9);
  const v1::JobStatus whole = wait_end(id);
  EXPECT_EQ(whole.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(whole.lost(), 0U);
  EXPECT_FALSE(whole.repairing());
  EXPECT_EQ(whole.stop().iterations(), 9U);
  audit(id, 9);
  expect_same(checkpoint_of(id), expected_film(9));
  EXPECT_TRUE(try_fetch(id, false).ok());
  EXPECT_TRUE(happened(id, "repaired"));
}

// Claim: `extend` of such a job renders what is lost along with what is added.
TEST_P(EndedTruth, ExtendRendersWhatIsLostToo) {
  const std::string id = done_job(9);
  stop_master();
  harm(id, GetParam());
  start();
  v1::ExtendJobRequest request;
  request.set_job_id(id);
  request.set_add_iterations(4);
  v1::JobStatus extended;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->ExtendJob(&context, request, &extended).ok());
  EXPECT_EQ(extended.stop().iterations(), 13U);
  render(id, 13);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  audit(id, 13);
  expect_same(checkpoint_of(id), expected_film(13));
}

INSTANTIATE_TEST_SUITE_P(, EndedTruth,
                         testing::Values(Harm::flip_newest, Harm::remove_newest, Harm::flip_all,
                                         Harm::remove_all),
                         [](const auto& one) { return name_of(one.param); });

// Claim: a repair renders what the job had and no more, though its stop rule would ask for more, and leads
// back to the state it had; a restart of the master in its midst changes nothing.
TEST_F(TruthTest, RepairLeadsBackToWhereTheJobWas) {
  const std::string id = submit(1000);
  render(id, 12);
  v1::JobRequest request;
  request.set_job_id(id);
  v1::JobStatus status;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->CancelJob(&context, request, &status).ok());
  wait_until(id, [](const v1::JobStatus& s) { return s.checkpoint_iterations() == s.iterations(); });
  const film::MergedFilm before = checkpoint_of(id);
  stop_master();
  harm(id, Harm::flip_all);
  start();
  ASSERT_TRUE(repair(id).first.ok());
  render(id, before.iterations() / 2);
  ASSERT_EQ(show(id).state(), v1::JOB_STATE_RUNNING);
  restart();
  EXPECT_TRUE(show(id).repairing());
  render(id, before.iterations());
  const v1::JobStatus after = wait_end(id);
  EXPECT_EQ(after.state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(after.lost(), 0U);
  expect_same(checkpoint_of(id), before);
  expect_ledger_is_film(id);
}

// Claim: to cancel a repair leaves the job as it was, with what is still lost.
TEST_F(TruthTest, ACancelledRepairStillKnowsWhatIsLost) {
  const std::string id = done_job(9);
  stop_master();
  harm(id, Harm::remove_all);
  start();
  ASSERT_TRUE(repair(id).first.ok());
  render(id, 2);
  v1::JobRequest request;
  request.set_job_id(id);
  v1::JobStatus status;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->CancelJob(&context, request, &status).ok());
  EXPECT_EQ(status.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(status.iterations() + status.lost(), 9U);
  EXPECT_GT(status.lost(), 0U);
}

// Claim: a job that has lost nothing is left alone by `repair`, one that runs says that there is nothing to
// do, and an unknown id is said to be unknown.
TEST_F(TruthTest, RepairOfWhatIsWholeDoesNothing) {
  const std::string id = done_job(4);
  const auto [status, same] = repair(id);
  EXPECT_TRUE(status.ok());
  EXPECT_EQ(same.state(), v1::JOB_STATE_DONE);
  EXPECT_FALSE(same.repairing());
  const std::string runs = submit(4);
  EXPECT_EQ(repair(runs).first.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(repair("../jobs").first.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(repair("").first.error_code(), grpc::StatusCode::NOT_FOUND);
}

// Claim: `verify` finds a whole farm whole, and names what is wrong with each file that is not: a checkpoint
// of a job that runs (whose film is in memory and is written again), a scene file, a folder of no job.
TEST_F(TruthTest, VerifyNamesEachDamage) {
  const std::string ended = done_job(4);
  const std::string runs = submit(1000);
  render(runs, 6);
  for (const v1::JobReport& report : verify())
    EXPECT_EQ(report.findings_size(), 0) << report.ShortDebugString();

  harm(runs, Harm::flip_all);
  const std::string hash = sha256_hex(kScene);
  flip_middle(folder.path() / "blobs" / hash.substr(0, 2) / hash);
  fs::create_directories(job_folder("jlost"));
  const auto reports = verify();
  ASSERT_EQ(reports.size(), 3U);
  for (const v1::JobReport& report : reports) {
    std::vector<std::string> parts;
    for (const v1::Finding& f : report.findings()) {
      parts.push_back(f.part());
      EXPECT_FALSE(f.text().empty());
      EXPECT_FALSE(f.mend().empty());
    }
    const std::vector<std::string> expected = report.job_id() == ended ? std::vector<std::string>{"scene"}
                                              : report.job_id() == runs
                                                  ? std::vector<std::string>{"film", "scene"}
                                                  : std::vector<std::string>{"store"};
    EXPECT_EQ(parts, expected) << report.ShortDebugString();
  }
  EXPECT_EQ(show(runs).lost(), 0U);
  // The film was in memory: it is on disk again, and a restart finds all of it.
  const std::uint64_t merged = show(runs).iterations();
  for (int i = 0; i < 2000 && checkpoints(runs).empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  restart();
  EXPECT_EQ(show(runs).iterations(), merged);
}

// Claim: a damaged checkpoint of a job that runs is said to be damaged, with its name and without advice to
// send anything again; the generation before serves, and what it lacks is rendered again without being asked
// for.
TEST_F(TruthTest, ADamagedCheckpointOfARunningJobIsSaid) {
  const std::string id = submit(30);
  render(id, 8);
  stop_master();
  harm(id, Harm::flip_newest);
  start();
  v1::ListEventsRequest request;
  request.set_job_id(id);
  v1::ListEventsResponse response;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->ListEvents(&context, request, &response).ok());
  std::string text;
  for (const v1::Event& e : response.events())
    if (e.kind() == "checkpoint-damaged") text = e.message();
  EXPECT_NE(text.find("film."), std::string::npos) << text;
  EXPECT_EQ(text.find("send it again"), std::string::npos) << text;
  EXPECT_EQ(show(id).lost(), 0U);
  render(id, 30);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  audit(id, 30);
  expect_same(checkpoint_of(id), expected_film(30));
}

// Claim: what a job that ends by its error has merged beyond its prefix is no damage; a job that is cancelled
// meanwhile keeps it, also where the master ends at once.
TEST_F(TruthTest, WhatIsAheadIsNoDamage) {
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
  v1::SubmitRequest wanted = submission(0);
  wanted.mutable_stop()->set_relmse(1e-9);
  const std::string id = test::submit(*farm, kScene, wanted);
  TestWorker slow(channel), fast(channel);
  fast.name = "fast";
  ASSERT_TRUE(slow.enrol().ok() && fast.enrol().ok());
  ASSERT_TRUE(slow.step()) << "the pilot";
  const auto held = slow.acquire();
  ASSERT_TRUE(held);
  while (fast.step()) {
  }
  ASSERT_GT(show(id).iterations(), 8U) << "some are beyond the first prefix";
  for (const v1::JobReport& report : verify(id))
    for (const auto& finding : report.findings()) ADD_FAILURE() << finding.text();
  const std::uint64_t iterations = show(id).iterations();
  v1::JobRequest request;
  request.set_job_id(id);
  v1::JobStatus out;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->CancelJob(&context, request, &out).ok());
  stop_master();
  start();
  EXPECT_EQ(show(id).iterations(), iterations);
  EXPECT_EQ(show(id).lost(), 0U);
}

// Claim: a damaged generation does not push the whole one before it off the disk: the two that are kept are
// whole ones.
TEST_F(TruthTest, DamagedGenerationsTakeNoPlace) {
  const std::string id = submit(1000);
  render(id, 8);
  stop_master();
  harm(id, Harm::flip_newest);
  start();
  const std::uint64_t held = show(id).iterations();
  render(id, held + 1);
  stop_master();
  const auto kept = checkpoints(id);
  ASSERT_EQ(kept.size(), 2U);
  for (const fs::path& path : kept) {
    const auto bytes = read_file(path, 1 << 28);
    ASSERT_TRUE(bytes.ok());
    EXPECT_TRUE(film::MergedFilm::parse(*bytes).ok()) << path;
  }
}

// Claim: where the store is lost, `verify` names the folders of its jobs, and `repair` takes each in: a done
// job with its film, one that ran goes on where its checkpoint was, and both come to the film they would have
// had. One that was asked for exact indices still is, and tells where its scene lay.
TEST_F(TruthTest, JobsOfALostStoreAreTakenIn) {
  const std::string done = done_job(9);
  v1::SubmitRequest request = submission(1);
  request.clear_stop();
  wire::to_proto(StopRule{}, *film::parse_half_indices("0-1,3/2"), *request.mutable_stop());
  request.set_scene_path("scenes/my box.xml");
  const std::string exact = test::submit(*farm, kScene, request);
  render(exact, 4);
  EXPECT_EQ(wait_end(exact).state(), v1::JOB_STATE_DONE);
  const std::string ran = submit(20);
  render(ran, 6);
  stop_master();
  for (const char* file : {"master.sqlite", "master.sqlite-wal", "master.sqlite-shm"})
    fs::remove(folder.path() / file);
  start();
  const auto reports = verify();
  ASSERT_EQ(reports.size(), 1U);
  EXPECT_EQ(reports[0].findings_size(), 3);
  EXPECT_TRUE(happened("", "orphans"));
  for (const std::string& id : {done, ran, exact}) {
    const auto [status, taken] = repair(id);
    ASSERT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(taken.id(), id);
    EXPECT_EQ(taken.name(), "test");
    EXPECT_TRUE(happened(id, "adopted"));
  }
  EXPECT_EQ(wait_end(done).state(), v1::JOB_STATE_DONE);
  const v1::JobStatus taken = wait_end(exact);
  EXPECT_EQ(taken.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(taken.stop().SerializeAsString(), request.stop().SerializeAsString());
  EXPECT_EQ(taken.scene_path(), request.scene_path());
  const film::MergedFilm film = checkpoint_of(exact);
  EXPECT_EQ(film::text_of(film::HalfSets{film.merged(0), film.merged(1)}), "0-1,3/2");
  expect_same(checkpoint_of(done), expected_film(9));
  render(ran, 20);
  EXPECT_EQ(wait_end(ran).state(), v1::JOB_STATE_DONE);
  expect_same(checkpoint_of(ran), expected_film(20));
  restart();
  for (const v1::JobReport& report : verify())
    EXPECT_EQ(report.findings_size(), 0) << report.ShortDebugString();
}

// Claim: health tells of an ended job that has lost samples, and of a scene file that a job waits for, until
// they are there again.
TEST_F(TruthTest, HealthTellsOfLostFiles) {
  const std::string ended = done_job(9);
  stop_master();
  harm(ended, Harm::remove_all);
  FarmOptions options;
  options.master.data_dir = folder.path();
  auto opened = Farm::open(options);
  ASSERT_TRUE(opened.ok()) << opened.error().to_string();
  Farm& one = **opened;
  for (int i = 0; i < 1000 && one.trouble().empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_NE(one.trouble().find(ended), std::string::npos) << one.trouble();
  EXPECT_NE(one.trouble().find("candela repair " + ended), std::string::npos) << one.trouble();
  opened = refused_error("closed");
  fs::remove_all(folder.path());

  start();
  const std::string waiting = submit(9);
  stop_master();
  opened = Farm::open(options);
  ASSERT_TRUE(opened.ok()) << opened.error().to_string();
  Farm& two = **opened;
  EXPECT_EQ(two.trouble(), "");
  two.blob_lost(sha256_hex(kScene), false);
  EXPECT_NE(two.trouble().find("scene.xml"), std::string::npos) << two.trouble();
  two.blob_found(sha256_hex(kScene));
  EXPECT_EQ(two.trouble(), "");
}

// Claim: a folder that does not tell enough is refused with a reason, and stays as it is.
TEST_F(TruthTest, AFolderWithoutAManifestIsRefused) {
  fs::create_directories(job_folder("jlost"));
  EXPECT_EQ(repair("jlost").first.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  std::ofstream(job_folder("jlost") / "job.manifest") << "CANMANI1 nonsense";
  EXPECT_EQ(repair("jlost").first.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_TRUE(fs::exists(job_folder("jlost")));
}

}  // namespace
}  // namespace candela::master
