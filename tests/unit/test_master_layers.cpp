// Layers that a master accepts for a job's film, and how its store remembers them.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <optional>

#include "common/base/log.h"
#include "common/film/film.h"
#include "master/master.h"
#include "master/store/sqlite_schema.h"
#include "master/store/store.h"
#include "tests/temporary_folder.h"
#include "tests/unit/farm_calls.h"
#include "tests/unit/hand_worker.h"
#include "tests/unit/store_file.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;
const std::string kScene = "<scene version='3.0.0'/>";

class MasterLayers : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(log::initialise("test", "off", "text").ok()); }
  void TearDown() override {
    farm_.reset();
    worker_.reset();
    master_.reset();
  }
  // A master with one job of this size, and a worker that has the lease of its pilot.
  void start(std::uint32_t width, std::uint32_t height) {
    MasterOptions options;
    options.data_dir = folder_;
    options.listen.clear();
    options.memory_bytes = 1ULL << 50;  // so that no film is too large for this machine alone
    auto master = Master::start(options);
    ASSERT_TRUE(master.ok()) << master.error().to_string();
    master_ = std::move(*master);
    const auto channel = master_->in_process_channel();
    farm_ = v1::FarmService::NewStub(channel);
    worker_.emplace(channel);
    JobSettings settings;
    settings.width = width;
    settings.height = height;
    job_ = test::submit(*farm_, kScene, test::submission(kScene, settings, 4));
    ASSERT_TRUE(worker_->enrol().ok());
    lease_ = acquire();
    ASSERT_EQ(lease_.unit().kind(), v1::Unit::KIND_PILOT);
  }
  v1::Lease acquire() {
    const auto lease = worker_->acquire_soon();
    EXPECT_TRUE(lease) << worker_->status.error_message();
    return lease.value_or(v1::Lease());
  }
  // OK only if the pilot was accepted.
  grpc::Status complete(const std::vector<std::string>& layers) {
    return complete(WorkPlan{.layers = layers});
  }
  grpc::Status complete(const WorkPlan& plan) {
    v1::CompletePilotRequest request;
    worker_->sign(request, lease_);
    request.mutable_named_state()->set_film_scale_log2(16);
    wire::to_proto(plan, *request.mutable_work());
    const bool accepted = worker_->complete(request);
    if (worker_->status.ok() && !accepted) return {grpc::StatusCode::ABORTED, "not accepted"};
    return worker_->status;
  }
  v1::JobStatus show() { return test::show(*farm_, job_); }
  v1::PushDeltaResponse push(const v1::Lease& lease, const film::Layout& layout) {
    const Unit unit = *wire::from_proto(lease.unit());
    film::UnitFilm film(layout, 16);
    film::SampleCounts sample_counts;
    for (std::uint32_t i = 0; i < layout.layers; ++i) film.splat(i, 3, 5, {1, 2, 3}, i, sample_counts);
    film.count(sample_counts);
    const std::string bytes = film::encode_delta(film, {unit, layout, 16, job_, std::string(build_id())});
    const v1::PushDeltaResponse response = worker_->push(worker_->header(lease, bytes), bytes);
    EXPECT_TRUE(worker_->status.ok());
    return response;
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
  std::unique_ptr<Master> master_;
  std::unique_ptr<v1::FarmService::Stub> farm_;
  std::optional<test::HandWorker> worker_;
  v1::Lease lease_;
  std::string job_;
};

// Claim: a pilot whose layers cannot be is refused with the field and the reason, and leaves the job as it
// was; the next sound one is taken.
TEST_F(MasterLayers, AnImpossiblePilotIsRefused) {
  start(40, 33);
  std::vector<std::string> too_many;
  for (int i = 0; i < 64; ++i)
    too_many.push_back(std::string("s") + static_cast<char>('a' + i / 8) + static_cast<char>('a' + i % 8));
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"a", "a"}, "two layers are called 'a'"},
      {{"error"}, "the error estimate has that name"},
      {{"a,b"}, "other characters"},
      {{""}, "empty"},
      {too_many, "64 layers"},
  };
  for (const auto& [layers, words] : cases) {
    const grpc::Status status = complete(layers);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_NE(status.error_message().find(words), std::string::npos) << status.error_message();
    EXPECT_NE(status.error_message().find("layers"), std::string::npos) << status.error_message();
    EXPECT_FALSE(show().has_named_state());
  }
  too_many.pop_back();
  EXPECT_TRUE(complete(too_many).ok());
  EXPECT_EQ(show().layers_size(), 63);
}

// Claim: a film that is too large only with its layers is refused when the pilot comes.
TEST_F(MasterLayers, AFilmTooLargeIsRefused) {
  start(16384, 16384);
  const grpc::Status status = complete({"a", "b", "c", "d"});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(status.error_message().find("cannot have 4 layers"), std::string::npos) << status.error_message();
  EXPECT_FALSE(show().has_named_state());
}

// Claim: a delta of another number of layers than the job's never merges; one of the job's does.
TEST_F(MasterLayers, DeltasMustHaveTheJobsLayers) {
  start(40, 33);
  ASSERT_TRUE(complete({"s2.t3", "s3.t2"}).ok());
  const v1::PushDeltaResponse few = push(acquire(), {40, 33, 1});
  EXPECT_EQ(few.verdict(), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_NE(few.message().find("the job's is of 40 x 33 x 3"), std::string::npos) << few.message();
  EXPECT_EQ(push(acquire(), {40, 33, 4}).verdict(), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(show().iterations(), 0U);
  ASSERT_TRUE(worker_->enrol().ok());
  EXPECT_EQ(push(acquire(), {40, 33, 3}).verdict(), v1::DELTA_VERDICT_MERGED);
  EXPECT_GT(show().iterations(), 0U);
}

// Claim: a job's deltas must have the accumulators of its plan: without them, or of another epoch, they are
// corrupt, and the film stays as it was; those of the plan merge.
TEST_F(MasterLayers, DeltasMustHaveTheJobsAccumulators) {
  using Per = film::AccumulatorSpec::Per;
  start(40, 33);
  WorkPlan plan;
  plan.accumulators = {{"sectors", 2, 8, Per::job}};
  plan.accumulators.push_back({"", 1, 0, Per::job});
  EXPECT_NE(complete(plan).error_message().find("accumulators"), std::string::npos);
  plan.accumulators.pop_back();
  ASSERT_TRUE(complete(plan).ok());
  const auto push_with = [&](const std::vector<film::AccumulatorSpec>& specs, std::uint64_t epoch) {
    const v1::Lease lease = acquire();
    film::UnitFilm film({40, 33, 1}, 16);
    film::DeltaWriter writer({*wire::from_proto(lease.unit()), {}, 0, job_, std::string(build_id())});
    writer.film(film);
    film::SampleCounts sample_counts;
    for (const film::AccumulatorSpec& spec : specs) {
      film::UnitAccumulator sums(40, 33, spec);
      sums.add(3, 4, 0, std::array<double, 1>{1.5}, 9, sample_counts);
      writer.accumulator(sums, epoch);
    }
    writer.counts(sample_counts);
    const std::string bytes = writer.finish();
    const v1::DeltaVerdict verdict = worker_->push(worker_->header(lease, bytes), bytes).verdict();
    EXPECT_EQ(verdict == v1::DELTA_VERDICT_MERGED, show().iterations() > 0);
    EXPECT_TRUE(worker_->enrol().ok());  // a worker that failed at a unit is not offered it again
    return verdict;
  };
  EXPECT_EQ(push_with({}, 0), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(push_with(plan.accumulators, 1), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(push_with(plan.accumulators, 0), v1::DELTA_VERDICT_MERGED);
}

// Claim: a store keeps a job's layers, which decide its film's layout; a job without any has the image alone.
// A store with layers that cannot be, or of a version to come, is refused.
TEST(StoreLayers, AreKept) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "s.sqlite";
  JobRow job;
  job.id = "j";
  job.settings.width = 30;
  job.settings.height = 20;
  job.stop.iterations = 7;
  job.named_state = NamedState{13};
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok()) << store.error().to_string();
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{job}}).ok());
    EXPECT_EQ(layout_of((*store)->load()->jobs.at(0)), (film::Layout{30, 20, 1}));
  }
  job.layers = {"weighted.s2.t3", "unweighted.s2.t3"};
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{job}}).ok());
  }
  {
    auto store = open_sqlite_store(path);
    const auto state = (*store)->load();
    ASSERT_TRUE(state.ok());
    EXPECT_EQ(state->jobs.at(0).layers, job.layers);
    EXPECT_EQ(layout_of(state->jobs.at(0)), (film::Layout{30, 20, 3}));
  }
  execute(path, "UPDATE jobs SET layers = 'a,a'");
  EXPECT_FALSE((*open_sqlite_store(path))->load().ok());
  execute(path, ("PRAGMA user_version=" + std::to_string(kSchemaVersion + 1)).c_str());
  EXPECT_FALSE(open_sqlite_store(path).ok());
}

}  // namespace
}  // namespace candela::master
