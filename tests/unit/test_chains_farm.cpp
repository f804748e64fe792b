// Whole farms over jobs of Markov chains: a real master and real workers in this process, with a renderer
// whose film is known beforehand (toy_chains.h).
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <numeric>

#include "candela/v1/client.grpc.pb.h"
#include "candela/v1/worker.grpc.pb.h"
#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/version.h"
#include "common/image/image.h"
#include "common/stats/image_error.h"
#include "common/wire/wire.h"
#include "master/master.h"
#include "master/merge/checkpoint.h"
#include "tests/temporary_folder.h"
#include "tests/unit/toy_chains.h"
#include "worker/service/farm_worker.h"

namespace candela::toy {
namespace {

namespace fs = std::filesystem;
using std::chrono::microseconds;
using worker::Milliseconds;

constexpr std::uint32_t kWidth = 40, kHeight = 33;  // four tiles, two of them cut
const std::string kScene = "a toy scene";

// A worker in the test's hands, that can fall silent and deliver anything.
class HandWorker {
 public:
  explicit HandWorker(const std::shared_ptr<grpc::Channel>& channel)
      : stub(v1::WorkerService::NewStub(channel)) {
    v1::RegisterRequest request;
    request.set_protocol(kProtocol);
    request.set_build_id(std::string(build_id()));
    request.set_threads(1);
    request.add_isas("avx2");
    grpc::ClientContext context;
    EXPECT_TRUE(stub->Register(&context, request, &session).ok());
  }
  std::optional<v1::Lease> acquire() {
    v1::AcquireLeaseRequest request;
    request.set_worker_id(session.worker_id());
    request.set_session(session.session());
    v1::AcquireLeaseResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(stub->AcquireLease(&context, request, &response).ok());
    if (!response.has_lease()) return std::nullopt;
    return response.lease();
  }
  template <class Request>
  void sign(Request& request, const v1::Lease& lease) const {
    request.set_worker_id(session.worker_id());
    request.set_session(session.session());
    request.set_token(lease.token());
  }
  grpc::Status pilot(const v1::Lease& lease,
                     const std::function<void(v1::CompletePilotRequest&)>& spoil = {}) {
    v1::CompletePilotRequest request;
    sign(request, lease);
    request.mutable_named_state()->set_film_scale_log2(kPilotScale);
    request.set_seconds_per_iteration(1e-4);
    for (const char* layer : {"independent", "segments"}) request.add_layers(layer);
    wire::to_proto(Toy::from(wire::from_proto(lease.settings())->integrator_settings).plan,
                   *request.mutable_chains());
    if (spoil) spoil(request);
    v1::CompletePilotResponse response;
    grpc::ClientContext context;
    return stub->CompletePilot(&context, request, &response);
  }
  bool bootstrap(const v1::Lease& lease) {
    const Unit unit = *wire::from_proto(lease.unit());
    std::vector<float> values(unit.end - unit.begin);
    const auto tallies =
        ToyRenderer(*wire::from_proto(lease.settings())).bootstrap(unit.begin, unit.end, values, {});
    v1::CompleteBootstrapRequest request;
    sign(request, lease);
    request.mutable_contributions()->Add(values.begin(), values.end());
    v1::CompleteBootstrapResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(stub->CompleteBootstrap(&context, request, &response).ok());
    return response.accepted();
  }
  struct Rendered {
    std::string film;
    std::vector<chains::ChainRecord> records;
  };
  static Rendered render(const v1::Lease& lease) {
    const ToyRenderer renderer(*wire::from_proto(lease.settings()));
    const Unit unit = *wire::from_proto(lease.unit());
    const NamedState state = *wire::from_proto(lease.named_state());
    std::vector<chains::ChainStart> starts;
    for (const auto& start : lease.chain_starts()) starts.push_back(*wire::from_proto(start));
    const auto film = renderer.make_film(state);
    Rendered out;
    EXPECT_TRUE(renderer.run_segments(unit, state, starts, *film, out.records, {}).ok());
    out.film = film::encode_delta(*film, {unit, {}, 0, lease.job_id(), std::string(build_id())});
    return out;
  }
  v1::PushDeltaResponse push(const v1::Lease& lease, const std::string& film, const std::string& records) {
    v1::DeltaChunk chunk;
    v1::DeltaHeader& h = *chunk.mutable_header();
    sign(h, lease);
    h.set_unit_id(lease.unit_id());
    h.set_job_id(lease.job_id());
    *h.mutable_unit() = lease.unit();
    h.set_build_id(std::string(build_id()));
    const std::string bytes = film + records;
    h.set_size_bytes(bytes.size());
    h.set_records_bytes(records.size());
    h.set_sha256(sha256_hex(bytes));
    v1::PushDeltaResponse response;
    grpc::ClientContext context;
    auto stream = stub->PushDelta(&context, &response);
    for (std::size_t at = 0; at < bytes.size(); at += 1 << 20) {
      chunk.set_data(bytes.substr(at, 1 << 20));
      if (!stream->Write(chunk)) break;
      chunk.Clear();
    }
    stream->WritesDone();
    status = stream->Finish();
    return response;
  }
  v1::DeltaVerdict deliver(const v1::Lease& lease) {
    const Rendered r = render(lease);
    return push(lease, r.film, chains::encode(std::span<const chains::ChainRecord>(r.records))).verdict();
  }
  // One lease, done; false if there was none.
  bool step() {
    const auto lease = acquire();
    if (!lease) return false;
    switch (lease->unit().kind()) {
      case v1::Unit::KIND_PILOT:
        return pilot(*lease).ok();
      case v1::Unit::KIND_BOOTSTRAP:
        return bootstrap(*lease);
      default:
        return deliver(*lease) == v1::DELTA_VERDICT_MERGED;
    }
  }

  std::unique_ptr<v1::WorkerService::Stub> stub;
  v1::RegisterResponse session;
  grpc::Status status;
};

class ChainFarm : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(log::initialise("test", "off", "text").ok());
    options_.data_dir = folder_ / "master";
    options_.listen = "127.0.0.1:0";
    options_.checkpoint_seconds = 0.05;
    options_.unit_seconds = 0.02;
    options_.lease_seconds = 2;
    options_.image_on_checkpoint = false;
    settings_.width = kWidth;
    settings_.height = kHeight;
    settings_.seed = 11;
    start();
  }
  void TearDown() override {
    workers_.clear();
    farm_.reset();
    master_.reset();
  }
  void start() {
    auto master = master::Master::start(options_);
    ASSERT_TRUE(master.ok()) << master.error().to_string();
    master_ = std::move(*master);
    options_.listen = "127.0.0.1:" + std::to_string(master_->port());  // workers find it again
    farm_ = v1::FarmService::NewStub(channel());
  }
  std::shared_ptr<grpc::Channel> channel() {
    grpc::ChannelArguments arguments;  // a master that was away is found again at once
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    for (const char* backoff : {GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, GRPC_ARG_MIN_RECONNECT_BACKOFF_MS,
                                GRPC_ARG_MAX_RECONNECT_BACKOFF_MS})
      arguments.SetInt(backoff, 20);
    return grpc::CreateCustomChannel(options_.listen, grpc::InsecureChannelCredentials(), arguments);
  }
  // With `lose` the newest checkpoint is not there afterwards: what a crash before it would leave, while the
  // store's rows tell of more.
  void restart(bool lose) {
    farm_.reset();
    master_.reset();
    std::map<std::uint64_t, fs::path> generations;
    for (const auto& job : fs::directory_iterator(options_.data_dir / "jobs"))
      for (const auto& e : fs::directory_iterator(job.path()))
        if (const std::string n = e.path().filename().string(); n.starts_with("film."))
          generations[std::stoull(n.substr(5))] = e.path();
    if (lose && !generations.empty()) fs::remove(generations.rbegin()->second);
    start();
  }
  void add_worker(microseconds per_segment) {
    worker::WorkerOptions o;
    o.cache_dir = folder_ / ("cache" + std::to_string(workers_.size()));
    o.threads = 1;
    worker::Tuning tuning;
    tuning.first_backoff = Milliseconds(5);
    tuning.longest_backoff = Milliseconds(40);
    worker::RendererFactory factory{
        [per_segment](const description::FileSource&, const std::string&,
                      const std::map<std::string, std::string>&, const JobSettings& settings,
                      unsigned) -> Result<std::unique_ptr<render::Renderer>> {
          return std::unique_ptr<render::Renderer>(std::make_unique<ToyRenderer>(settings, per_segment));
        },
        [] { return std::vector<std::string>{"avx2"}; }};
    auto started = worker::FarmWorker::start(o, channel(), std::move(factory), tuning);
    ASSERT_TRUE(started.ok()) << started.error().to_string();
    workers_.push_back(std::move(*started));
  }
  std::string submit(std::uint64_t rounds) {
    settings_.integrator_settings = toy_.settings();
    v1::UploadBlobRequest blob;
    blob.set_sha256(sha256_hex(kScene));
    blob.set_size_bytes(kScene.size());
    blob.set_data(kScene);
    {
      grpc::ClientContext context;
      v1::UploadBlobResponse response;
      auto stream = farm_->UploadBlob(&context, &response);
      stream->Write(blob);
      stream->WritesDone();
      EXPECT_TRUE(stream->Finish().ok());
    }
    v1::SubmitRequest r;
    r.mutable_bundle()->set_main_path("scene.xml");
    v1::BundleFile& file = *r.mutable_bundle()->add_files();
    file.set_path("scene.xml");
    file.set_sha256(blob.sha256());
    file.set_size_bytes(kScene.size());
    wire::to_proto(settings_, *r.mutable_settings());
    r.mutable_stop()->set_iterations(rounds);
    v1::SubmitResponse response;
    grpc::ClientContext context;
    const grpc::Status status = farm_->Submit(&context, r, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.job_id();
  }
  v1::JobStatus show(const std::string& id) {
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::JobStatus out;
    grpc::ClientContext context;
    EXPECT_TRUE(farm_->GetJob(&context, request, &out).ok());
    return out;
  }
  template <class Condition>
  v1::JobStatus wait_for(const std::string& id, Condition condition, double seconds = 60) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    v1::JobStatus status = show(id);
    while (!condition(status) && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      status = show(id);
    }
    EXPECT_TRUE(condition(status)) << status.ShortDebugString();
    return status;
  }
  v1::JobStatus wait_end(const std::string& id) {
    return wait_for(id, [](const v1::JobStatus& s) { return s.state() >= v1::JOB_STATE_DONE; });
  }
  fs::path fetch(const std::string& id, const std::function<void(v1::FetchImageRequest&)>& change = {}) {
    v1::FetchImageRequest request;
    request.set_job_id(id);
    if (change) change(request);
    grpc::ClientContext context;
    auto stream = farm_->FetchImage(&context, request);
    v1::FetchImageChunk chunk;
    std::string bytes;
    while (stream->Read(&chunk)) bytes += chunk.data();
    const grpc::Status status = stream->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    const fs::path path = folder_ / ("image" + std::to_string(images_++) + ".exr");
    EXPECT_TRUE(write_file_atomically(path, bytes).ok());
    return path;
  }
  v1::GetLedgerResponse ledger(const std::string& id) {
    v1::GetLedgerRequest request;
    request.set_job_id(id);
    v1::GetLedgerResponse out;
    grpc::ClientContext context;
    EXPECT_TRUE(farm_->GetLedger(&context, request, &out).ok());
    return out;
  }
  // Everything that a job of so many rounds must have come to: sums, records, b, picture, and an account of
  // them that agrees with itself.
  void check(const std::string& id, std::uint64_t rounds) {
    const Expected expected = expect(settings_, rounds);
    const v1::JobStatus status = show(id);
    EXPECT_EQ(status.iterations(), rounds);
    EXPECT_EQ(status.named_state().bootstrap_b(), expected.state.bootstrap_b);
    EXPECT_EQ(status.named_state().film_scale_log2(), expected.state.film_scale_log2);
    const chains::Normalisation b = chains::pool(expected.bootstrap, expected.counts());
    EXPECT_EQ(status.chains().b(), b.b);
    EXPECT_EQ(status.chains().b_standard_error(), b.standard_error);
    EXPECT_EQ(status.chains().b_samples(), b.samples);

    const auto bytes = read_file(options_.data_dir / "jobs" / id /
                                     ("film." + std::to_string(status.checkpoint_generation()) + ".ckpt"),
                                 1 << 28);
    ASSERT_TRUE(bytes.ok());
    const auto checkpoint = master::parse_checkpoint(*bytes, toy_.plan.chains);
    ASSERT_TRUE(checkpoint.ok()) << checkpoint.error().to_string();
    EXPECT_TRUE(checkpoint->film.serialise() == expected.film.serialise());
    for (std::size_t c = 0; c < expected.records.size(); ++c)
      ASSERT_TRUE(*checkpoint->records[c] == expected.records[c]) << "chain " << c;

    const auto picture = image::read_image(fetch(id));
    ASSERT_TRUE(picture.ok());
    EXPECT_EQ(picture->rgb, film::develop_image(expected.film, expected.development()));

    const v1::GetLedgerResponse account = ledger(id);
    std::array<film::IndexSet, 2> rows, film;
    for (const auto& r : account.merged()) {
      EXPECT_EQ(r.unit().kind(), v1::Unit::KIND_SEGMENTS);
      EXPECT_TRUE(rows[r.unit().half()].insert(r.unit().begin(), r.unit().end()));
    }
    for (const auto& r : account.film()) EXPECT_TRUE(film[r.half()].insert(r.begin(), r.end()));
    EXPECT_EQ(rows, film);
    EXPECT_EQ(film[0].count() + film[1].count(), rounds * toy_.plan.chains);
    EXPECT_EQ(account.chain_segments(), rounds * toy_.plan.chains);
    EXPECT_EQ(status.units_merged(), static_cast<std::uint64_t>(account.merged_size()));
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
  master::MasterOptions options_;
  JobSettings settings_;
  Toy toy_;
  std::unique_ptr<master::Master> master_;
  std::unique_ptr<v1::FarmService::Stub> farm_;
  std::vector<std::unique_ptr<worker::Worker>> workers_;
  int images_ = 0;
};

// Claim: one worker or sixteen, even or so uneven that one does nine tenths of the work: sums, chains, b and
// picture are the same to the last bit.
TEST_F(ChainFarm, OneWorker) {
  add_worker(microseconds(50));
  const std::string id = submit(12);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 12);
}
TEST_F(ChainFarm, FourWorkers) {
  for (int i = 0; i < 4; ++i) add_worker(microseconds(200));
  const std::string id = submit(12);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 12);
}
TEST_F(ChainFarm, SixteenWorkers) {
  for (int i = 0; i < 16; ++i) add_worker(microseconds(1000));
  const std::string id = submit(12);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 12);
}
TEST_F(ChainFarm, UnevenWorkers) {
  toy_.plan.chains = 200;
  add_worker(microseconds(400));
  for (int i = 0; i < 3; ++i) add_worker(microseconds(12000));
  const std::string id = submit(20);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 20);
  std::map<std::string, std::uint64_t> segments;
  const v1::GetLedgerResponse account = ledger(id);
  for (const auto& row : account.merged()) segments[row.worker_id()] += row.unit().end() - row.unit().begin();
  std::uint64_t most = 0;
  for (const auto& [worker, count] : segments) most = std::max(most, count);
  EXPECT_EQ(segments.size(), 4U);
  EXPECT_GT(most, 20 * toy_.plan.chains * 3 / 4) << "the work was even after all";
}

// Claim: a master that goes away twenty times, from the bootstrap on, and every other time with less on disk
// than its store tells of, loses nothing that counts.
TEST_F(ChainFarm, TheMasterDiesTwentyTimes) {
  toy_.plan.bootstrap_samples = 60000;  // more than five units, whatever the load
  for (int i = 0; i < 2; ++i) add_worker(microseconds(300));
  const std::string id = submit(150);
  constexpr int kInBootstrap = 5;
  std::uint64_t seen = 0;
  for (int death = 0; death < 20; ++death) {
    const bool early = death < kInBootstrap;
    const v1::JobStatus status = wait_for(id, [&](const v1::JobStatus& s) {
      if (s.state() != v1::JOB_STATE_RUNNING && s.state() != v1::JOB_STATE_QUEUED) return true;
      return early ? s.chains().bootstrap_done() > seen : s.units_merged() > seen;
    });
    ASSERT_EQ(status.state(), v1::JOB_STATE_RUNNING) << "the job ended after " << death << " deaths";
    ASSERT_EQ(status.has_named_state(), !early) << "death " << death;
    restart(death % 2 == 1);
    const v1::JobStatus after = show(id);
    EXPECT_GE(after.chains().bootstrap_done(), status.chains().bootstrap_done());
    seen = death + 1 < kInBootstrap ? after.chains().bootstrap_done() : after.units_merged();
  }
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 150);
}

// Claim: workers that fall silent in the midst of bootstrap and segments, that deliver twice, late, or what
// is not theirs cost time and nothing else.
TEST_F(ChainFarm, LostAndRepeatedDeliveries) {
  options_.lease_seconds = 0.3;
  restart(false);
  const std::string id = submit(10);
  std::vector<v1::Lease> lost;
  int twice = 0;
  for (int i = 0; i < 3000 && show(id).state() < v1::JOB_STATE_DONE; ++i) {
    HandWorker w(channel());
    if (i % 7 == 0) {
      if (const auto lease = w.acquire()) lost.push_back(*lease);  // and never heard of again
      continue;
    }
    const auto lease = w.acquire();
    if (!lease) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      continue;
    }
    if (lease->unit().kind() == v1::Unit::KIND_PILOT) {
      ASSERT_TRUE(w.pilot(*lease).ok());
    } else if (lease->unit().kind() == v1::Unit::KIND_BOOTSTRAP) {
      EXPECT_TRUE(w.bootstrap(*lease));
      EXPECT_FALSE(w.bootstrap(*lease)) << "twice";
    } else {
      EXPECT_EQ(w.deliver(*lease), v1::DELTA_VERDICT_MERGED);
      twice += w.deliver(*lease) == v1::DELTA_VERDICT_DUPLICATE ? 1 : 0;
    }
  }
  EXPECT_GT(lost.size(), 3U);
  EXPECT_GT(twice, 5);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 10);
}

// Claim: records that are not what the unit's chains left are corrupt and change nothing; a unit is never
// merged without them.
TEST_F(ChainFarm, ContradictoryRecordsAreCorrupt) {
  toy_.plan.chains = 400;  // units of more than one, though the master counts all these workers as its own
  const std::string id = submit(2);
  const auto lease = [&](HandWorker& w) {
    std::optional<v1::Lease> l = w.acquire();
    while (l && l->unit().kind() != v1::Unit::KIND_SEGMENTS) {
      EXPECT_TRUE(l->unit().kind() == v1::Unit::KIND_PILOT ? w.pilot(*l).ok() : w.bootstrap(*l));
      l = w.acquire();
    }
    EXPECT_TRUE(l);
    return *l;
  };
  const auto encode = [](const std::vector<chains::ChainRecord>& records) {
    return chains::encode(std::span<const chains::ChainRecord>(records));
  };
  int units = 0;
  const auto verdict = [&](const std::function<void(HandWorker::Rendered&)>& spoil) {
    HandWorker w(channel());
    if (++units % 3 == 0) {  // no unit fails four times
      EXPECT_TRUE(w.step());
    }
    const v1::Lease l = lease(w);
    HandWorker::Rendered r = HandWorker::render(l);
    spoil(r);
    return w.push(l, r.film, encode(r.records)).verdict();
  };
  EXPECT_EQ(verdict([](auto& r) { r.records.pop_back(); }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.records.push_back(r.records[0]); }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.records[0].segments = 2; }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.records[0].counts.accepted = 1ULL << 40; }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.film[r.film.size() / 2] ^= 1; }), v1::DELTA_VERDICT_CORRUPT);
  HandWorker w(channel());
  const v1::Lease l = lease(w);
  w.push(l, HandWorker::render(l).film, "");
  EXPECT_EQ(w.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(w.status.error_message().find("records_bytes"), std::string::npos);
  EXPECT_EQ(w.deliver(l), v1::DELTA_VERDICT_MERGED);
  HandWorker last(channel());
  while (last.step()) {
  }
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 2);
}

// Claim: a pilot of chains that cannot be is refused by its field, and the job stays as it was.
TEST_F(ChainFarm, ImpossiblePilotsAreRefused) {
  const std::string id = submit(2);
  HandWorker w(channel());
  const auto lease = w.acquire();
  ASSERT_TRUE(lease);
  const auto refused = [&](const char* field, const std::function<void(v1::CompletePilotRequest&)>& spoil) {
    const grpc::Status status = w.pilot(*lease, spoil);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << field;
    EXPECT_NE(status.error_message().find(field), std::string::npos) << status.error_message();
  };
  refused("chains.chains", [](auto& r) { r.mutable_chains()->set_chains(7); });
  refused("chains.segment_mutations", [](auto& r) { r.mutable_chains()->set_segment_mutations(0); });
  refused("layers", [](auto& r) { r.clear_layers(); });
  EXPECT_FALSE(show(id).has_chains());
  EXPECT_TRUE(w.pilot(*lease).ok());
  EXPECT_TRUE(show(id).has_chains());
  EXPECT_TRUE(std::isnan(show(id).chains().b()));
}

// Claim: the picture converges to the known function, b to its mean, and the estimated errors are of the true
// ones' size. The sum of squared errors over that of estimated variances, of 1320 pixels with one degree of
// freedom each, has a standard deviation near 0.06: 0.25 is four of them, as is the bound of b; together a
// seed in some 8000 fails.
TEST_F(ChainFarm, ThePictureIsTheFunction) {
  toy_.direct = true;
  toy_.plan.segment_mutations = 2000;
  for (int i = 0; i < 2; ++i) add_worker(microseconds(0));
  const std::string id = submit(100);
  const v1::JobStatus end = wait_end(id);
  ASSERT_EQ(end.state(), v1::JOB_STATE_DONE);
  check(id, 100);
  const auto picture =
      image::read_image(fetch(id, [](v1::FetchImageRequest& r) { r.set_error_layer(true); }));
  double b = 0, squares = 0, relative = 0, variance = 0;
  const std::uint32_t pixels = kWidth * kHeight;
  for (std::uint32_t p = 0; p < pixels; ++p) b += toy_.f(p) / static_cast<double>(pixels);
  const double mean = b + 0.5;  // g's mean over 1320 pixels is exactly a half
  const Expected expected = expect(settings_, 100);
  const auto map = stats::error_map(expected.film, expected.development());
  for (std::uint32_t p = 0; p < pixels; ++p) {
    const double truth = toy_.f(p) + toy_.g(p);
    const double error = static_cast<double>(picture->rgb[3 * p]) - truth;
    squares += error * error;
    variance += std::pow(static_cast<double>(map[3 * p]), 2);
    relative += error * error / (truth * truth + 0.01 * mean * mean) / pixels;
  }
  EXPECT_NEAR(squares / variance, 1, 0.25);
  EXPECT_NEAR(relative / end.relmse_estimate(), 1, 0.5);
  EXPECT_LT(std::abs(end.chains().b() - b), 4 * end.chains().b_standard_error());
  EXPECT_LT(end.chains().b_standard_error(), 0.01 * b) << "or the line above proves nothing";
  std::uint64_t mutations = 0, large = 0;
  for (const auto& group : end.chains().groups()) {
    mutations += group.mutations();
    large += group.large_steps();
    EXPECT_GT(group.accepted(), 0U);
    EXPECT_GT(group.longest_stay(), 0U);
  }
  EXPECT_EQ(mutations, 100 * toy_.plan.chains * toy_.plan.segment_mutations);
  EXPECT_NEAR(static_cast<double>(large) / static_cast<double>(mutations), kLargeStep, 0.001);
  EXPECT_EQ(end.chains().b_samples(), toy_.plan.bootstrap_samples + large);
}

// Claim: an image of chains explains itself; the layers it is made of are there only on request, others
// always unless the image alone is wanted; all of them add up.
TEST_F(ChainFarm, ImagesExplainThemselves) {
  toy_.direct = true;
  add_worker(microseconds(0));
  const std::string id = submit(5);
  const v1::JobStatus end = wait_end(id);
  EXPECT_EQ(std::vector<std::string>(end.layers().begin(), end.layers().end()),
            std::vector<std::string>{"segments"});
  const fs::path plain = fetch(id);
  const auto picture = image::read_image(plain);
  ASSERT_TRUE(picture.ok());
  const auto& m = picture->metadata;
  EXPECT_EQ(m.at("candela:iterations"), "5");
  EXPECT_EQ(m.at("candela:chains"), "40");
  EXPECT_EQ(m.at("candela:segments"), "200");
  EXPECT_EQ(m.at("candela:mutations"), "40000");
  EXPECT_EQ(std::stod(m.at("candela:b")), end.chains().b());
  EXPECT_EQ(m.at("candela:b_samples"), std::to_string(end.chains().b_samples()));
  EXPECT_EQ(std::stod(m.at("candela:bootstrap_b")), end.named_state().bootstrap_b());
  EXPECT_EQ(m.at("candela:layers"), "segments");
  EXPECT_GT(std::stod(m.at("candela:acceptance")), 0.1);
  EXPECT_NE(m.at("candela:rejected_infinite"), "0") << "the bootstrap's";
  EXPECT_TRUE(image::read_layer(plain, "segments").ok());
  EXPECT_FALSE(image::read_layer(plain, "independent").ok());
  const fs::path only = fetch(id, [](v1::FetchImageRequest& r) { r.set_image_only(true); });
  EXPECT_FALSE(image::read_layer(only, "segments").ok());
  EXPECT_EQ(image::read_image(only)->rgb, picture->rgb);
  const fs::path raw = fetch(id, [](v1::FetchImageRequest& r) { r.set_chain_layers(true); });
  const auto chains_part = image::read_layer(raw, "raw.chains"),
             other = image::read_layer(raw, "raw.independent");
  ASSERT_TRUE(chains_part.ok() && other.ok());
  const double factor = end.chains().b() / end.named_state().bootstrap_b();
  for (std::size_t i = 0; i < picture->rgb.size(); ++i)
    ASSERT_NEAR(factor * static_cast<double>(chains_part->rgb[i]) + static_cast<double>(other->rgb[i]),
                static_cast<double>(picture->rgb[i]), 1e-5);
}

// Claim: a job without light ends soon after its bootstrap, black, and says why; light that needs no chain is
// rendered all the same.
TEST_F(ChainFarm, BlackJobs) {
  toy_.black = true;
  for (int i = 0; i < 2; ++i) add_worker(microseconds(0));
  const std::string black = submit(1000000);
  const v1::JobStatus end = wait_end(black);
  EXPECT_EQ(end.state(), v1::JOB_STATE_DONE);
  EXPECT_NE(end.message().find("none of 1000 bootstrap samples found light"), std::string::npos)
      << end.message();
  EXPECT_EQ(end.named_state().film_scale_log2(), kPilotScale);
  EXPECT_EQ(end.chains().b(), 0);
  const auto picture = image::read_image(fetch(black));
  ASSERT_TRUE(picture.ok());
  EXPECT_EQ(picture->rgb, std::vector<float>(std::size_t{kWidth} * kHeight * 3));
  toy_.direct = true;
  const std::string lit = submit(20);
  EXPECT_EQ(wait_end(lit).state(), v1::JOB_STATE_DONE);
  check(lit, 20);
}

// Claim: extended jobs of chains are jobs of all rounds, exactly; paused and resumed on the way.
TEST_F(ChainFarm, PauseAndExtend) {
  add_worker(microseconds(200));
  const std::string id = submit(10);
  wait_for(id, [](const v1::JobStatus& s) { return s.units_merged() > 0; });
  v1::JobRequest request;
  request.set_job_id(id);
  v1::JobStatus out;
  {
    grpc::ClientContext context;
    ASSERT_TRUE(farm_->PauseJob(&context, request, &out).ok());
  }
  restart(false);
  EXPECT_EQ(show(id).state(), v1::JOB_STATE_PAUSED);
  {
    grpc::ClientContext context;
    ASSERT_TRUE(farm_->ResumeJob(&context, request, &out).ok());
  }
  EXPECT_EQ(wait_end(id).iterations(), 10U);
  check(id, 10);
  restart(false);  // what is told of an ended job does not need its film
  EXPECT_EQ(show(id).chains().b_samples(),
            chains::pool(expect(settings_, 10).bootstrap, expect(settings_, 10).counts()).samples);
  v1::ExtendJobRequest more;
  more.set_job_id(id);
  more.set_add_iterations(7);
  grpc::ClientContext context;
  ASSERT_TRUE(farm_->ExtendJob(&context, more, &out).ok());
  EXPECT_EQ(wait_end(id).iterations(), 17U);
  check(id, 17);
}

// Claim: leases of chains with large states stay small enough for a message.
TEST_F(ChainFarm, LargeStatesMakeSmallLeases) {
  toy_.plan.chains = 400;
  toy_.plan.segment_mutations = 2;
  toy_.state_bytes = 60000;
  const std::string id = submit(3);
  HandWorker w(channel());
  std::size_t largest = 0;
  while (const auto lease = w.acquire()) {
    largest = std::max(largest, lease->ByteSizeLong());
    if (lease->unit().kind() == v1::Unit::KIND_PILOT)
      ASSERT_TRUE(w.pilot(*lease).ok());
    else if (lease->unit().kind() == v1::Unit::KIND_BOOTSTRAP)
      ASSERT_TRUE(w.bootstrap(*lease));
    else
      ASSERT_EQ(w.deliver(*lease), v1::DELTA_VERDICT_MERGED);
  }
  EXPECT_GT(largest, 1U << 20);
  EXPECT_LT(largest, 2200000U);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 3);
}

}  // namespace
}  // namespace candela::toy
