// Whole farms over jobs of Markov chains, as a fixture: a real master and real workers in this process, with
// a renderer whose film is known beforehand (toy_chains.h).
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <map>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/image/image.h"
#include "master/master.h"
#include "master/merge/checkpoint.h"
#include "tests/expect_invariants.h"
#include "tests/temporary_folder.h"
#include "tests/token_channel.h"
#include "tests/unit/farm_calls.h"
#include "tests/unit/hand_worker.h"
#include "tests/unit/toy_chains.h"
#include "worker/service/farm_worker.h"

namespace candela::toy {

namespace fs = std::filesystem;
using std::chrono::microseconds;

inline constexpr std::uint32_t kWidth = 40, kHeight = 33;  // four tiles, two of them cut
inline const std::string kScene = "a toy scene";

// A worker in the test's hands that renders toy chains.
class ToyWorker : public test::HandWorker {
 public:
  explicit ToyWorker(const std::shared_ptr<grpc::Channel>& channel) : HandWorker(channel) {
    EXPECT_TRUE(enrol().ok());
  }
  std::optional<v1::Lease> acquire() {
    auto lease = HandWorker::acquire();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return lease;
  }
  grpc::Status pilot(const v1::Lease& lease,
                     const std::function<void(v1::CompletePilotRequest&)>& spoil = {}) {
    v1::CompletePilotRequest request;
    sign(request, lease);
    request.mutable_named_state()->set_film_scale_log2(kPilotScale);
    request.set_seconds_per_iteration(1e-4);
    for (const char* layer : {"independent", "segments"}) request.mutable_work()->add_layers(layer);
    wire::to_proto(Toy::from(wire::from_proto(lease.settings())->integrator_settings).plan,
                   *request.mutable_work()->mutable_chains());
    if (spoil) spoil(request);
    complete(request);
    return status;
  }
  static render::UnitOutput render(const v1::Lease& lease) {
    const ToyRenderer renderer(*wire::from_proto(lease.settings()));
    const Unit unit = *wire::from_proto(lease.unit());
    const NamedState state = *wire::from_proto(lease.named_state());
    std::vector<chains::ChainStart> starts;
    for (const auto& start : lease.chain_starts()) starts.push_back(*wire::from_proto(start));
    render::UnitOutput output;
    if (makes_film(unit.kind)) output = renderer.make_output(state);
    EXPECT_TRUE(renderer.run(unit, {state, {}, starts}, output, {}).ok());
    return output;
  }
  v1::PushDeltaResponse push(const v1::Lease& lease, const render::UnitOutput& output) {
    const film::DeltaInfo info{
        *wire::from_proto(lease.unit()), {}, 0, lease.job_id(), std::string(build_id())};
    const std::string bytes = encode_delta(info, output);
    return HandWorker::push(header(lease, bytes), bytes);
  }
  v1::DeltaVerdict deliver(const v1::Lease& lease) { return push(lease, render(lease)).verdict(); }
  // One lease, done; false if there was none.
  bool step() {
    const auto lease = acquire();
    if (!lease) return false;
    if (lease->unit().kind() == v1::Unit::KIND_PILOT) return pilot(*lease).ok();
    return deliver(*lease) == v1::DELTA_VERDICT_MERGED;
  }
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
    options_.observer = test::expect_invariants();
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
    for (const char* backoff : {GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, GRPC_ARG_MAX_RECONNECT_BACKOFF_MS})
      arguments.SetInt(backoff, 20);
    // The time that one attempt to connect may take: on a busy machine a handshake waits for its turn.
    arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 10000);
    return test::token_channel(options_.listen, options_.data_dir, arguments);
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
  // `name`: empty for the host's, which all others have.
  void add_worker(microseconds per_segment, const std::string& name = "") {
    worker::WorkerOptions o;
    o.name = name;
    o.cache_dir = folder_ / ("cache" + std::to_string(workers_.size()));
    o.threads = 1;
    worker::Tuning tuning;
    tuning.first_backoff = worker::Milliseconds(5);
    tuning.longest_backoff = worker::Milliseconds(40);
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
    return test::submit(*farm_, kScene, test::submission(kScene, settings_, rounds));
  }
  v1::JobStatus show(const std::string& id) { return test::show(*farm_, id); }
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
    const fs::path path = folder_ / ("image" + std::to_string(images_++) + ".exr");
    EXPECT_TRUE(write_file_atomically(path, test::fetch(*farm_, request)).ok());
    return path;
  }
  v1::GetLedgerResponse ledger(const std::string& id) { return test::ledger(*farm_, id); }
  // The result of the settings' job, which is made once.
  const Expected& expected_after(std::uint64_t rounds) {
    const auto key = std::make_pair(settings_.integrator_settings, rounds);
    const auto known = expected_.find(key);
    return known != expected_.end() ? known->second
                                    : expected_.emplace(key, expect(settings_, rounds)).first->second;
  }
  // Everything that a job of so many rounds must have come to: sums, records, b, picture, and an account of
  // them that agrees with itself.
  void check(const std::string& id, std::uint64_t rounds) {
    const Expected& expected = expected_after(rounds);
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
  std::map<std::pair<SettingsMap, std::uint64_t>, Expected> expected_;
};

}  // namespace candela::toy
