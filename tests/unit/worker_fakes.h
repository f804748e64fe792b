// A master and a renderer that do as a test tells them, for the tests of the worker service.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "candela/v1/worker.grpc.pb.h"
#include "common/base/hash.h"
#include "common/film/film.h"
#include "common/job/bundle.h"
#include "common/wire/wire.h"
#include "worker/service/farm_worker.h"

namespace candela::worker {

// The fake renderer adds this to a pixel: a function of the pixel and the iteration alone.
inline std::array<float, 3> fake_radiance(std::uint32_t x, std::uint32_t y, std::uint64_t iteration) {
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(iteration % 7)};
}

// State that the fake renderers share with their test.
struct FakeRendererControl {
  std::mutex mutex;
  std::condition_variable changed;
  int created = 0;
  int running = 0;
  bool gate_closed = false;    // runs wait within, until it opens or they are stopped
  int permits = 0;             // runs that a closed gate lets through
  float progress_at_gate = 0;  // what they report meanwhile
  std::optional<Error> create_error, run_error;
  bool throw_bad_alloc = false;
  bool deaf = false;                                // a stop does not end a run
  std::vector<Unit> runs;                           // in order
  std::vector<std::string> layers;                  // what the pilot says; layer i holds i times the image
  std::vector<film::AccumulatorSpec> accumulators;  // of two channels: the number of samples, and of x
  std::map<std::string, std::string> states;        // what a unit was given, by name
  bool overflow = false;                            // one pixel gets more than 64 bits hold
  std::map<std::string, std::string> files;         // read at creation: key -> bytes

  void close_gate(float progress) {
    const std::lock_guard lock(mutex);
    gate_closed = true;
    progress_at_gate = progress;
  }
  void open_gate() {
    const std::lock_guard lock(mutex);
    gate_closed = false;
    changed.notify_all();
  }
};

class FakeRenderer final : public render::Renderer {
 public:
  FakeRenderer(FakeRendererControl& control, const JobSettings& settings)
      : control_(control), settings_(settings) {
    layer_names_ = control.layers;
    accumulators_ = control.accumulators;
  }

  render::UnitOutput make_output(const NamedState& state) const override {
    render::UnitOutput output;
    output.film = std::make_unique<film::UnitFilm>(
        film::Layout{settings_.width, settings_.height, 1 + static_cast<std::uint32_t>(layer_names_.size())},
        state.film_scale_log2);
    for (const film::AccumulatorSpec& spec : accumulators_)
      output.accumulators.push_back(
          std::make_unique<film::UnitAccumulator>(settings_.width, settings_.height, spec));
    return output;
  }
  Result<PilotResult> pilot(const render::RunContext&) const override {
    return PilotResult{{12}, "a plan", 0.25, {.layers = layer_names_, .accumulators = accumulators_}};
  }
  Result<void> run(const Unit& unit, const render::UnitInput& input, render::UnitOutput& output,
                   const render::RunContext& context) const override {
    {
      std::unique_lock lock(control_.mutex);
      if (control_.run_error) return *control_.run_error;
      if (control_.throw_bad_alloc) throw std::bad_alloc();
      ++control_.running;
      control_.runs.push_back(unit);
      context.progress->store(control_.progress_at_gate);
      control_.changed.notify_all();
      wait_at_gate(lock, context);
      --control_.running;
    }
    Unit done = unit;
    if (unit.kind == Unit::Kind::segments) {  // each goes through the gate
      for (done.end = unit.begin; done.end < unit.end; ++done.end) {
        if (done.end > unit.begin) {
          if (context.cut_short()) break;
          std::unique_lock lock(control_.mutex);
          wait_at_gate(lock, context);
        }
        output.records.push_back(input.starts[done.end - unit.begin].record);
        ++output.records.back().segments;
      }
    }
    if (context.stop->load()) return refused_error("stopped");
    if (unit.kind == Unit::Kind::bootstrap) {
      for (std::uint64_t i = unit.begin; i < unit.end; ++i) output.table.push_back(static_cast<float>(i));
      output.counts.rejected[0] = 1;
      return {};
    }
    {
      const std::lock_guard lock(control_.mutex);
      for (const auto& [name, bytes] : input.states) control_.states[name] = std::string(bytes);
    }
    film::UnitFilm& film = *output.film;
    film::SampleCounts sample_counts;
    if (control_.overflow) {
      const auto most = static_cast<float>(std::ldexp(film::kMaxContribution, -film.scale_log2()));
      for (std::uint64_t i = 0; i < 256; ++i) film.add(0, 0, 0, {most, most, most}, i, sample_counts);
    }
    for (std::uint64_t i = done.begin; i < done.end; ++i)
      for (std::uint32_t y = 0; y < settings_.height; ++y)
        for (std::uint32_t x = 0; x < settings_.width; ++x) {
          const std::uint64_t key = rng::key(settings_.seed, unit.half, i, x, y);
          film.add(0, x, y, fake_radiance(x, y, i), key, sample_counts);
          for (std::uint32_t layer = 1; layer <= layer_names_.size(); ++layer) {
            auto value = fake_radiance(x, y, i);
            for (float& v : value) v *= static_cast<float>(layer);
            film.splat(layer, x, y, value, key, sample_counts);
          }
          for (const auto& sums : output.accumulators)
            sums->add(x, y, 0, std::array<double, 2>{1, static_cast<double>(x)}, key, sample_counts);
          ++sample_counts.eye_samples;
          sample_counts.light_paths += layer_names_.size();
        }
    film.count(sample_counts);
    return {};
  }
  Result<std::string> plan_text() const override { return std::string("a plan"); }

 private:
  void wait_at_gate(std::unique_lock<std::mutex>& lock, const render::RunContext& context) const {
    while (control_.gate_closed && control_.permits == 0 && (control_.deaf || !context.stop->load()))
      control_.changed.wait_for(lock, std::chrono::milliseconds(5));
    if (control_.permits > 0) --control_.permits;
  }

  FakeRendererControl& control_;
  JobSettings settings_;
  std::vector<std::string> layer_names_;
  std::vector<film::AccumulatorSpec> accumulators_;
};

inline RendererFactory fake_factory(FakeRendererControl& control) {
  return {[&control](const description::FileSource& files, const std::string& main_key,
                     const std::map<std::string, std::string>&, const JobSettings& settings,
                     unsigned) -> Result<std::unique_ptr<render::Renderer>> {
            for (const std::string& key : {main_key, std::string("../textures/a.bin")}) {
              CANDELA_ASSIGN(const auto bytes, files.open(key));
              const std::lock_guard lock(control.mutex);
              control.files[key] = std::string(bytes.view);
            }
            const std::lock_guard lock(control.mutex);
            ++control.created;
            if (control.create_error) return *control.create_error;
            return std::unique_ptr<render::Renderer>(std::make_unique<FakeRenderer>(control, settings));
          },
          [] {
            return std::vector<std::string>{"sse2", "avx2"};
          }};
}

// Serves a queue of leases and records what is said to it. Scripts are queues of answers that come before the
// usual one.
class FakeMaster final : public v1::WorkerService::Service {
 public:
  FakeMaster() {
    blobs_ = {{sha256_hex("the scene"), "the scene"}, {sha256_hex("the texture"), "the texture"}};
    bundle_.main_path = "scene.xml";
    bundle_.files = {{"../textures/a.bin", sha256_hex("the texture"), 11},
                     {"scene.xml", sha256_hex("the scene"), 9}};
    grpc::ServerBuilder builder;
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~FakeMaster() override { server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(1)); }

  std::shared_ptr<grpc::Channel> channel() { return server_->InProcessChannel({}); }

  // ---- what tests set up and look at, under `mutex`
  // --------------------------------------------------------------------
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<grpc::Status> register_script, acquire_script, push_script, heartbeat_script, pilot_script,
      blob_script;
  std::deque<v1::DeltaVerdict> verdicts;  // then MERGED
  std::set<std::uint64_t> revoked, to_cut;
  std::set<std::uint64_t> urgent;    // leases that a full worker gets
  std::set<std::uint64_t> no_place;  // deltas that the merge queue has no place for
  int refuse_after_ms = 0;
  bool drain = false;
  bool wrong_blob_bytes = false;
  std::uint32_t heartbeat_ms = 20;

  std::deque<v1::Lease> leases;
  int registrations = 0, acquisitions = 0, heartbeats = 0, pushes = 0, deregistrations = 0, blob_fetches = 0;
  std::vector<std::uint64_t> blob_offsets;  // of each fetch
  bool saw_prefetch = false, saw_full = false;
  std::uint64_t fetched_size = 0;  // as the first request for a blob says it
  v1::RegisterRequest registered;
  std::vector<std::string> warm;
  std::vector<std::uint64_t> merged, returned;  // tokens
  std::set<std::uint64_t> returned_computing;   // those of them that the worker was still computing
  std::vector<v1::FailUnitRequest> failures;
  std::vector<v1::CompletePilotRequest> pilots;
  std::map<std::uint64_t, std::string> deltas;  // by token, as received last
  std::map<std::uint64_t, v1::DeltaHeader> headers;
  std::map<std::uint64_t, double> fractions;  // the last heartbeat's
  std::map<std::uint64_t, v1::UnitProgress> reports;

  // Adds a lease of iterations [begin, end) of half 0; its token is 100 + the unit's number.
  std::uint64_t add_lease(std::uint64_t begin, std::uint64_t end, bool pilot = false,
                          double expected_seconds = 0) {
    const std::lock_guard lock(mutex);
    return add_lease_unlocked(begin, end, pilot, expected_seconds);
  }
  // Precondition: `mutex` is held.
  std::uint64_t add_lease_unlocked(std::uint64_t begin, std::uint64_t end, bool pilot = false,
                                   double expected_seconds = 0) {
    v1::Lease lease;
    lease.set_unit_id(++units_);
    lease.set_expected_seconds(expected_seconds);
    lease.set_token(100 + units_);
    lease.set_job_id("job1");
    lease.set_bundle_sha256(bundle_.hash());
    JobSettings settings;
    settings.width = 40;
    settings.height = 8;
    settings.seed = 5;
    wire::to_proto(settings, *lease.mutable_settings());
    wire::to_proto(Unit{pilot ? Unit::Kind::pilot : Unit::Kind::iterations, 0, begin, end},
                   *lease.mutable_unit());
    if (!pilot) lease.mutable_named_state()->set_film_scale_log2(12);
    leases.push_back(lease);
    return lease.token();
  }
  // Names a state in the last lease; the master has its bytes.
  void add_state(const std::string& name, const std::string& bytes) {
    const std::lock_guard lock(mutex);
    v1::DecidedState& state = *leases.back().add_states();
    state.set_name(name);
    state.set_sha256(sha256_hex(bytes));
    state.set_size_bytes(bytes.size());
    blobs_[state.sha256()] = bytes;
  }
  template <class Condition>
  [[nodiscard]] bool wait_for(Condition condition, int milliseconds = 5000) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, std::chrono::milliseconds(milliseconds), condition);
  }
  std::string session() const { return "session" + std::to_string(sessions_); }

  // ---- the service
  // -----------------------------------------------------------------------------------------------------
  grpc::Status Register(grpc::ServerContext*, const v1::RegisterRequest* request,
                        v1::RegisterResponse* response) override {
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    ++registrations;
    registered = *request;
    if (const auto status = next(register_script); !status.ok()) return status;
    ++sessions_;
    response->set_worker_id("w1");
    response->set_session(session());
    response->set_heartbeat_ms(heartbeat_ms);
    response->set_lease_ms(1000);
    response->set_max_chunk_bytes(4096);
    return grpc::Status::OK;
  }
  grpc::Status AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest* request,
                            v1::AcquireLeaseResponse* response) override {
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    ++acquisitions;
    if (const auto status = check(request->session()); !status.ok()) return status;
    if (const auto status = next(acquire_script); !status.ok()) return status;
    saw_prefetch = saw_prefetch || request->prefetch();
    saw_full = saw_full || request->full();
    warm.assign(request->warm_bundles().begin(), request->warm_bundles().end());
    response->set_drain(drain);
    response->set_retry_ms(20);
    if (!drain && !leases.empty() && (!request->full() || urgent.contains(leases.front().token()))) {
      *response->mutable_lease() = leases.front();
      leases.pop_front();
    }
    return grpc::Status::OK;
  }
  grpc::Status Heartbeat(grpc::ServerContext*, const v1::HeartbeatRequest* request,
                         v1::HeartbeatResponse* response) override {
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    ++heartbeats;
    if (const auto status = check(request->session()); !status.ok()) return status;
    if (const auto status = next(heartbeat_script); !status.ok()) return status;
    fractions.clear();
    reports.clear();
    for (const auto& unit : request->units()) {
      fractions[unit.token()] = unit.fraction();
      reports[unit.token()] = unit;
      if (to_cut.contains(unit.token())) response->add_cut_tokens(unit.token());
      if (revoked.contains(unit.token())) response->add_revoked_tokens(unit.token());
    }
    response->set_drain(drain);
    return grpc::Status::OK;
  }
  grpc::Status ReturnLease(grpc::ServerContext*, const v1::ReturnLeaseRequest* request,
                           v1::ReturnLeaseResponse*) override {
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    if (const auto status = check(request->session()); !status.ok()) return status;
    returned.push_back(request->token());
    if (request->computing()) returned_computing.insert(request->token());
    return grpc::Status::OK;
  }
  grpc::Status FailUnit(grpc::ServerContext*, const v1::FailUnitRequest* request,
                        v1::FailUnitResponse*) override {
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    if (const auto status = check(request->session()); !status.ok()) return status;
    failures.push_back(*request);
    return grpc::Status::OK;
  }
  grpc::Status CompletePilot(grpc::ServerContext*, const v1::CompletePilotRequest* request,
                             v1::CompletePilotResponse* response) override {
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    if (const auto status = next(pilot_script); !status.ok()) return status;
    pilots.push_back(*request);
    response->set_accepted(true);
    return grpc::Status::OK;
  }
  grpc::Status PushDelta(grpc::ServerContext*, grpc::ServerReader<v1::DeltaChunk>* reader,
                         v1::PushDeltaResponse* response) override {
    v1::DeltaChunk chunk;
    v1::DeltaHeader header;
    std::string bytes;
    if (!reader->Read(&chunk)) return {grpc::StatusCode::INVALID_ARGUMENT, "no chunk came"};
    header = chunk.header();
    {
      const std::lock_guard lock(mutex);
      const Notify notify(*this);
      ++pushes;
      if (const auto status = check(header.session()); !status.ok()) return status;
      if (const auto status = next(push_script); !status.ok()) return status;
      if (no_place.contains(header.token())) {
        std::this_thread::sleep_for(std::chrono::milliseconds(refuse_after_ms));
        return wire::to_status_with_retry(resource_error("the merge queue is full"), 50);
      }
    }
    reader->SendInitialMetadata();
    bytes = chunk.data();
    while (reader->Read(&chunk)) bytes += chunk.data();
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    response->set_verdict(v1::DELTA_VERDICT_MERGED);
    if (!verdicts.empty()) {
      response->set_verdict(verdicts.front());
      verdicts.pop_front();
    }
    if (response->verdict() == v1::DELTA_VERDICT_MERGED) merged.push_back(header.token());
    headers[header.token()] = header;
    deltas[header.token()] = std::move(bytes);
    return grpc::Status::OK;
  }
  grpc::Status GetBundle(grpc::ServerContext*, const v1::GetBundleRequest* request,
                         v1::Bundle* response) override {
    if (request->bundle_sha256() != bundle_.hash()) return {grpc::StatusCode::NOT_FOUND, "no such bundle"};
    wire::to_proto(bundle_, *response);
    return grpc::Status::OK;
  }
  grpc::Status FetchBlob(grpc::ServerContext*, const v1::FetchBlobRequest* request,
                         grpc::ServerWriter<v1::FetchBlobChunk>* writer) override {
    std::string content;
    grpc::Status status;
    {
      const std::lock_guard lock(mutex);
      const Notify notify(*this);
      if (++blob_fetches == 1) fetched_size = request->size_bytes();
      const auto found = blobs_.find(request->sha256());
      if (found == blobs_.end()) return {grpc::StatusCode::NOT_FOUND, "no such blob"};
      content = found->second;
      if (wrong_blob_bytes) content[0] = '!';
      status = next(blob_script);
      blob_offsets.push_back(request->offset());
      content.erase(0, request->offset());
    }
    // A scripted failure comes in the middle of the transfer.
    const std::size_t end = status.ok() ? content.size() : content.size() / 2;
    for (std::size_t at = 0; at < end; at += 3) {
      v1::FetchBlobChunk chunk;
      chunk.set_data(content.substr(at, std::min<std::size_t>(3, end - at)));
      chunk.set_size_bytes(content.size());
      writer->Write(chunk);
    }
    return status;
  }
  grpc::Status Deregister(grpc::ServerContext*, const v1::DeregisterRequest*,
                          v1::DeregisterResponse*) override {
    const std::lock_guard lock(mutex);
    const Notify notify(*this);
    ++deregistrations;
    return grpc::Status::OK;
  }

  // The master forgets the session, as one that was restarted without its store would. Under `mutex`.
  void forget_session() { ++sessions_; }
  std::string bundle_hash() const { return bundle_.hash(); }

 private:
  struct Notify {
    explicit Notify(FakeMaster& owner) : master(owner) {}
    ~Notify() { master.changed.notify_all(); }
    Notify(const Notify&) = delete;
    Notify& operator=(const Notify&) = delete;
    FakeMaster& master;
  };
  grpc::Status check(const std::string& given) const {
    return given == session() ? grpc::Status::OK
                              : grpc::Status(grpc::StatusCode::UNAUTHENTICATED, "register again");
  }
  static grpc::Status next(std::deque<grpc::Status>& script) {
    if (script.empty()) return grpc::Status::OK;
    grpc::Status status = script.front();
    script.pop_front();
    return status;
  }

  std::map<std::string, std::string> blobs_;
  bundle::Bundle bundle_;
  std::unique_ptr<grpc::Server> server_;
  std::uint64_t units_ = 0;
  int sessions_ = 0;
};

}  // namespace candela::worker
