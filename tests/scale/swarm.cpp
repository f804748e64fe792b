#include "tests/scale/swarm.h"
#include "tests/token_channel.h"

#include <fmt/format.h>
#include <grpcpp/alarm.h>
#include <grpcpp/generic/generic_stub.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>

#include "candela/v1/worker.grpc.pb.h"
#include "common/base/version.h"
#include "common/job/job.h"
#include "common/rng/stream.h"
#include "common/wire/wire.h"

namespace candela::scale {
namespace {

using Clock = std::chrono::steady_clock;
using Done = std::function<void(bool ok)>;

constexpr unsigned kPollers = 2;
constexpr std::uint32_t kRetryMs = 500;  // after a call that failed

double seconds_between(Clock::time_point a, Clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

std::shared_ptr<grpc::Channel> dial(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // a connection for each worker
  return test::token_channel_by_environment(address, arguments);
}

void set_deadline(grpc::ClientContext& context, double seconds) {
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::milliseconds(std::lround(seconds * 1e3)));
}

struct Task {
  v1::Lease lease;
  Clock::time_point first;                                            // when its rendering began
  Clock::time_point begun;                                            // since when it is to be charged
  bool refused = false;                                               // the queue was full for its delta
  bool urgent = false;                                                // leased while the other deltas waited
  std::shared_ptr<Delivery> delivery = std::make_shared<Delivery>();  // packed once
};

}  // namespace

class SwarmWorker {
 public:
  SwarmWorker(Swarm& swarm, std::size_t index)
      : swarm_(swarm),
        index_(index),
        channel_(dial(swarm.options_.address)),
        stub_(v1::WorkerService::NewStub(channel_)),
        generic_(channel_) {
    // Speeds in geometric order, mixed.
    const double place = rng::to_float(static_cast<std::uint32_t>(rng::key(index, 1))) - 0.5;
    slowness_ = std::pow(swarm.options_.spread, place);
  }

  void start(double after_seconds) {
    wait(after_seconds, [this] { sign_on(); });
  }
  void stop() {
    const std::lock_guard lock(mutex_);
    for (grpc::ClientContext* context : calls_) context->TryCancel();
    for (grpc::Alarm* alarm : alarms_) alarm->Cancel();
  }
  // For the unit that is being rendered.
  void charge_until(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    charge(now);
  }

 private:
  // --- operations; `then` runs on a thread of the swarm, under this worker's lock, unless the swarm is over
  // ---
  void wait(double seconds, std::function<void()> then) {
    auto alarm = std::make_shared<grpc::Alarm>();
    alarms_.push_back(alarm.get());
    alarm->Set(&swarm_.queue_,
               std::chrono::system_clock::now() + std::chrono::microseconds(std::lround(seconds * 1e6)),
               swarm_.tag([this, alarm, then = std::move(then)](bool) {
                 const std::lock_guard lock(mutex_);
                 std::erase(alarms_, alarm.get());
                 if (!swarm_.over_) then();
               }));
  }

  template <class Request, class Response>
  using Prepare = std::unique_ptr<grpc::ClientAsyncResponseReader<Response>> (v1::WorkerService::Stub::*)(
      grpc::ClientContext*, const Request&, grpc::CompletionQueue*);

  // `then(status, response, seconds)`.
  template <class Request, class Response, class Then>
  void call(Prepare<Request, Response> method, const Request& request, Then then, double deadline = 30) {
    struct Call {
      grpc::ClientContext context;
      Response response;
      grpc::Status status;
      std::unique_ptr<grpc::ClientAsyncResponseReader<Response>> reader;
      Clock::time_point begun = Clock::now();
    };
    auto call = std::make_shared<Call>();
    set_deadline(call->context, deadline);
    call->context.set_wait_for_ready(true);
    calls_.push_back(&call->context);
    call->reader = ((*stub_).*method)(&call->context, request, &swarm_.queue_);
    call->reader->Finish(&call->response, &call->status,
                         swarm_.tag([this, call, then = std::move(then)](bool) {
                           const double seconds = seconds_between(call->begun, Clock::now());
                           const std::lock_guard lock(mutex_);
                           std::erase(calls_, &call->context);
                           if (swarm_.over_) return;
                           note(call->status);
                           then(call->status, call->response, seconds);
                         }));
  }

  template <class F>
  void count(F&& f) {
    const std::lock_guard lock(swarm_.mutex_);
    f(swarm_.counts_);
  }
  void note(const grpc::Status& status) {
    if (status.ok() || status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED) return;
    count([&](SwarmCounts& c) {
      ++c.failed_calls;
      c.last_failure = fmt::format("{} {}", static_cast<int>(status.error_code()), status.error_message());
    });
  }
  template <class Request>
  Request signed_request() const {
    Request request;
    request.set_worker_id(id_);
    request.set_session(session_);
    return request;
  }

  // --- a worker's life ---
  void sign_on() {
    v1::RegisterRequest request;
    request.set_protocol(kProtocol);
    request.set_build_id(std::string(build_id()));
    request.set_name(fmt::format("swarm-{:04}", index_));
    request.set_host("localhost");
    request.set_threads(swarm_.options_.threads_per_worker);
    for (const char* isa : {"sse2", "sse4.2", "avx", "avx2"}) request.add_isas(isa);
    request.set_memory_bytes(32ULL << 30);
    call<v1::RegisterRequest, v1::RegisterResponse>(
        &v1::WorkerService::Stub::AsyncRegister, request,
        [this](const grpc::Status& status, const v1::RegisterResponse& response, double) {
          if (!status.ok()) return wait(kRetryMs * 1e-3, [this] { sign_on(); });
          id_ = response.worker_id();
          session_ = response.session();
          heartbeat_seconds_ = response.heartbeat_ms() * 1e-3;
          ++swarm_.registered_;
          wait(heartbeat_seconds_, [this] { heartbeat(); });
          acquire();
        });
  }

  // The session is lost: all leases are, too.
  void sign_on_again() {
    if (id_.empty()) return;
    id_.clear();
    --swarm_.registered_;
    charge(Clock::now());
    pending_.clear();
    rendering_.reset();
    outbox_.clear();
    ++push_round_;
    push_waits_ = packing_ = false;
    ++generation_;
    ++session_count_;
    sign_on();
  }

  void heartbeat() {
    if (id_.empty()) return;
    auto request = signed_request<v1::HeartbeatRequest>();
    const auto name = [&](const v1::Lease& lease) { request.add_units()->set_token(lease.token()); };
    for (const Task& task : pending_) name(task.lease);
    for (const Task& task : outbox_) name(task.lease);
    if (rendering_) name(rendering_->lease);
    request.set_resident_bytes(2ULL << 30);
    call<v1::HeartbeatRequest, v1::HeartbeatResponse>(
        &v1::WorkerService::Stub::AsyncHeartbeat, request,
        [this](const grpc::Status& status, const v1::HeartbeatResponse& response, double seconds) {
          if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) return sign_on_again();
          if (status.ok()) {
            count([&](SwarmCounts& c) {
              c.heartbeat_seconds.push_back(static_cast<float>(seconds));
              c.revoked += static_cast<std::uint64_t>(response.revoked_tokens_size());
            });
            for (const std::uint64_t token : response.revoked_tokens()) drop(token);
            for (const std::uint64_t token : response.cut_tokens()) cut(token);
          }
          wait(heartbeat_seconds_, [this] { heartbeat(); });
        });
  }

  void drop(std::uint64_t token) {
    std::erase_if(pending_, [&](const Task& task) { return task.lease.token() == token; });
    if (rendering_ && rendering_->lease.token() == token) {
      charge(Clock::now());
      rendering_.reset();
      ++generation_;
      render_next();
    }
    // A delivery under way gets its verdict.
    for (std::size_t i = 1; i < outbox_.size(); ++i)
      if (outbox_[i].lease.token() == token)
        outbox_.erase(outbox_.begin() + static_cast<std::ptrdiff_t>(i--));
  }

  // As a worker does: the iteration under way is the unit's last, and what was not begun goes back.
  void cut(std::uint64_t token) {
    const auto waiting = std::find_if(pending_.begin(), pending_.end(),
                                      [&](const Task& task) { return task.lease.token() == token; });
    if (waiting != pending_.end()) {
      pending_.erase(waiting);
      auto request = signed_request<v1::ReturnLeaseRequest>();
      request.set_token(token);
      call<v1::ReturnLeaseRequest, v1::ReturnLeaseResponse>(
          &v1::WorkerService::Stub::AsyncReturnLease, request,
          [this](const grpc::Status& status, const v1::ReturnLeaseResponse&, double) {
            if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) return sign_on_again();
            acquire();
          });
    }
    if (!rendering_ || rendering_->lease.token() != token) return;
    v1::Unit& unit = *rendering_->lease.mutable_unit();
    const double elapsed = seconds_between(rendering_->first, Clock::now());
    const auto done = static_cast<std::uint64_t>(std::floor(elapsed / seconds_per_iteration())) + 1;
    if (unit.begin() + done >= unit.end()) return;  // it ends of itself
    unit.set_end(unit.begin() + done);
    ++generation_;
    deliver_after(static_cast<double>(done) * seconds_per_iteration() - elapsed);
    count([](SwarmCounts& c) { ++c.cut; });
  }

  void acquire() {
    if (asking_ || id_.empty() || !pending_.empty()) return;
    const bool full = outbox_.size() == 2 && !rendering_;
    if (outbox_.size() >= 2 && !full) return;
    asking_ = true;
    auto request = signed_request<v1::AcquireLeaseRequest>();
    request.set_prefetch(rendering_.has_value());
    request.set_full(full);
    if (!warm_.empty()) request.add_warm_bundles(warm_);
    call<v1::AcquireLeaseRequest, v1::AcquireLeaseResponse>(
        &v1::WorkerService::Stub::AsyncAcquireLease, request,
        [this, full](const grpc::Status& status, v1::AcquireLeaseResponse& response, double seconds) {
          asking_ = false;
          if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) return sign_on_again();
          if (!status.ok()) return wait(kRetryMs * 1e-3, [this] { acquire(); });
          count([&](SwarmCounts& c) {
            c.lease_seconds.push_back(static_cast<float>(seconds));
            ++(response.has_lease() ? c.leases : c.empty_answers);
          });
          if (!response.has_lease())
            return wait(std::clamp(response.retry_ms(), 10U, 10000U) * 1e-3, [this] { acquire(); });
          take(std::move(*response.mutable_lease()), full);
          acquire();
        });
  }

  void take(v1::Lease lease, bool urgent) {
    warm_ = lease.bundle_sha256();
    if (lease.unit().kind() == v1::Unit::KIND_PILOT) return complete_pilot(lease);
    pending_.emplace_back();
    pending_.back().lease = std::move(lease);
    pending_.back().urgent = urgent;
    render_next();
  }

  void complete_pilot(const v1::Lease& lease) {
    auto request = signed_request<v1::CompletePilotRequest>();
    const PilotResult& pilot = swarm_.recording_.pilot();
    request.set_token(lease.token());
    wire::to_proto(pilot.state, *request.mutable_named_state());
    request.set_plan(pilot.plan);
    request.set_seconds_per_iteration(seconds_per_iteration());
    wire::to_proto(pilot.work, *request.mutable_work());
    call<v1::CompletePilotRequest, v1::CompletePilotResponse>(
        &v1::WorkerService::Stub::AsyncCompletePilot, request,
        [this](const grpc::Status& status, const v1::CompletePilotResponse& response, double) {
          if (status.ok() && response.accepted()) count([](SwarmCounts& c) { ++c.pilots; });
        });
  }

  double seconds_per_iteration() const { return swarm_.options_.seconds_per_iteration * slowness_; }
  static std::uint64_t iterations(const v1::Lease& lease) {
    return lease.unit().end() - lease.unit().begin();
  }

  void charge(Clock::time_point now) {
    if (!rendering_) return;
    const double seconds = seconds_between(rendering_->begun, now);
    rendering_->begun = now;
    count([&](SwarmCounts& c) { c.busy_seconds[rendering_->lease.job_id()] += seconds; });
  }

  void render_next() {
    if (rendering_ || pending_.empty() || outbox_.size() >= (pending_.front().urgent ? 3U : 2U)) return;
    rendering_ = std::move(pending_.front());
    pending_.pop_front();
    rendering_->begun = rendering_->first = Clock::now();
    deliver_after(seconds_per_iteration() * static_cast<double>(iterations(rendering_->lease)));
    acquire();
  }

  void deliver_after(double seconds) {
    wait(seconds, [this, generation = generation_] {
      if (generation != generation_ || !rendering_) return;
      charge(Clock::now());
      outbox_.push_back(std::move(*rendering_));
      rendering_.reset();
      if (outbox_.size() == 1)
        push();
      else if (packing_ && swarm_.hurries(outbox_.back().lease.job_id()))
        pass_unpacked();
      else
        pass();
      render_next();
      acquire();
    });
  }

  // --- delivery: the whole stream, message by message ---
  struct PushCall {
    grpc::ClientContext context;
    std::unique_ptr<grpc::GenericClientAsyncReaderWriter> stream;
    std::shared_ptr<Delivery> delivery;
    std::size_t next = 0;
    bool place = false;  // asked for, and told
    grpc::ByteBuffer answer;
    grpc::Status status;
    v1::PushDeltaResponse response;
    bool answered = false;
    std::uint64_t session_count = 0;
    Clock::time_point begun = Clock::now();
  };

  // As the worker does: a delta that was not refused passes one that was.
  bool pass() {
    const auto next = std::find_if(outbox_.begin(), outbox_.end(), [](const Task& t) { return !t.refused; });
    if (!push_waits_ || next == outbox_.end()) return false;
    std::rotate(outbox_.begin(), next, next + 1);
    push();
    return true;
  }

  // A real worker packs its deltas itself and at once. Here one thread packs those of all workers: an urgent
  // one does not wait until it has come to the delta before it.
  void pass_unpacked() {
    std::rotate(outbox_.begin(), outbox_.end() - 1, outbox_.end());
    push();
  }

  void push() {
    ++push_round_;
    push_waits_ = false;
    auto call = std::make_shared<PushCall>();
    call->session_count = session_count_;
    call->delivery = outbox_.front().delivery;
    packing_ = call->delivery->messages.empty();
    if (!packing_) return begin(call);
    const bool first = swarm_.hurries(outbox_.front().lease.job_id());
    swarm_.pack(first, [this, call, round = push_round_, lease = outbox_.front().lease,
                        header = signed_request<v1::DeltaHeader>()]() mutable {
      {
        const std::lock_guard lock(mutex_);
        if (round != push_round_ || call->session_count != session_count_) return;  // another one goes first
      }
      header.set_render_seconds(seconds_per_iteration() * static_cast<double>(iterations(lease)));
      const std::size_t which = Swarm::recording_of(lease.unit_id(), swarm_.recording_);
      *call->delivery = swarm_.recording_.deliver(which, lease, std::move(header));
      const std::lock_guard lock(mutex_);
      if (swarm_.over_ || round != push_round_ || call->session_count != session_count_) return;
      packing_ = false;
      begin(call);
    });
  }

  void begin(const std::shared_ptr<PushCall>& call) {
    set_deadline(call->context, 600);
    calls_.push_back(&call->context);
    call->begun = Clock::now();
    call->stream =
        generic_.PrepareCall(&call->context, "/candela.v1.WorkerService/PushDelta", &swarm_.queue_);
    call->stream->StartCall(swarm_.tag([this, call](bool ok) { push_on(call, ok); }));
  }

  void push_on(const std::shared_ptr<PushCall>& call, bool ok) {
    // As a worker does: the bytes follow the header when the master says that it has a place for them.
    if (ok && call->next == 1 && !call->place) {
      call->place = true;
      return call->stream->ReadInitialMetadata(swarm_.tag([this, call](bool told) { push_on(call, told); }));
    }
    if (ok && call->next < call->delivery->messages.size()) {
      const grpc::ByteBuffer& message = call->delivery->messages[call->next++];
      return call->stream->Write(message, swarm_.tag([this, call](bool fine) { push_on(call, fine); }));
    }
    // All is written, or the master has answered before: the answer comes either way.
    const auto read = [this, call](bool) {
      call->stream->Read(&call->answer, swarm_.tag([this, call](bool got) {
        call->answered = got;
        call->stream->Finish(&call->status, swarm_.tag([this, call](bool) { push_ended(call); }));
      }));
    };
    if (ok)
      call->stream->WritesDone(swarm_.tag(read));
    else
      read(false);
  }

  void push_ended(const std::shared_ptr<PushCall>& call) {
    const double seconds = seconds_between(call->begun, Clock::now());
    if (call->answered && call->status.ok())
      call->status = grpc::GenericDeserialize<grpc::ProtoBufferReader, v1::PushDeltaResponse>(
          &call->answer, &call->response);
    const std::lock_guard lock(mutex_);
    std::erase(calls_, &call->context);
    if (swarm_.over_) return;
    note(call->status);
    if (call->status.error_code() == grpc::StatusCode::UNAUTHENTICATED) return sign_on_again();
    if (outbox_.empty() || call->session_count != session_count_) return;
    if (!call->status.ok()) {
      const bool full = call->status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED;
      if (full) count([](SwarmCounts& c) { ++c.queue_full; });
      const double told = full ? wire::retry_ms(call->status, kRetryMs) * 1e-3 : kRetryMs * 1e-3;
      outbox_.front().refused = push_waits_ = true;
      if (pass()) return;
      return wait(told * (1 + 0.25 * slowness_ / swarm_.options_.spread), [this, round = push_round_] {
        if (outbox_.empty() || round != push_round_) return;
        for (Task& task : outbox_) task.refused = false;
        push();
      });
    }
    const bool merged = call->response.verdict() == v1::DELTA_VERDICT_MERGED;
    count([&](SwarmCounts& c) {
      ++(merged ? c.merged : c.other_verdicts);
      c.delta_bytes += call->delivery->bytes;
      c.push_seconds.push_back(static_cast<float>(seconds));
    });
    outbox_.pop_front();
    if (!outbox_.empty()) push();
    render_next();
    acquire();
  }

  Swarm& swarm_;
  const std::size_t index_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::WorkerService::Stub> stub_;
  grpc::GenericStub generic_;
  double slowness_ = 1, heartbeat_seconds_ = 5;

  std::mutex mutex_;
  std::vector<grpc::ClientContext*> calls_;
  std::vector<grpc::Alarm*> alarms_;
  std::string id_, session_, warm_;
  std::uint64_t session_count_ = 0;
  std::uint64_t generation_ = 0;  // of the unit that is rendered; another one when it was lost
  bool asking_ = false;
  std::deque<Task> pending_, outbox_;
  std::uint64_t push_round_ = 0;
  bool push_waits_ = false;  // the front one's wait goes on
  bool packing_ = false;     // the front one is not packed yet
  std::optional<Task> rendering_;
};

Swarm::Swarm(const SwarmOptions& options, const Recording& recording)
    : options_(options), recording_(recording) {
  for (std::size_t i = 0; i < options_.workers; ++i)
    workers_.push_back(std::make_unique<SwarmWorker>(*this, i));
  for (std::size_t i = 0; i < workers_.size(); ++i)
    workers_[i]->start(options_.ramp_seconds * static_cast<double>(i) / static_cast<double>(workers_.size()));
  for (unsigned i = 0; i < kPollers; ++i) threads_.emplace_back([this] { poll(); });
  threads_.emplace_back([this] { pack_loop(); });
}

Swarm::~Swarm() {
  over_ = true;
  for (const auto& worker : workers_) worker->stop();
  packing_.notify_all();
  while (under_way_ > 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  queue_.Shutdown();
  for (std::thread& thread : threads_) thread.join();
}

void Swarm::poll() {
  void* what = nullptr;
  bool ok = false;
  while (queue_.Next(&what, &ok)) {
    const std::unique_ptr<Done> done(static_cast<Done*>(what));
    (*done)(ok);
    --under_way_;
  }
}

void* Swarm::tag(Done done) {
  ++under_way_;
  return new Done(std::move(done));
}

void Swarm::hurry(std::string job) {
  const std::lock_guard lock(pack_mutex_);
  hurried_ = std::move(job);
}

bool Swarm::hurries(const std::string& job) {
  const std::lock_guard lock(pack_mutex_);
  return !hurried_.empty() && job == hurried_;
}

void Swarm::pack(bool first, std::function<void()> make) {
  {
    const std::lock_guard lock(pack_mutex_);
    if (first)
      to_pack_.push_front(std::move(make));
    else
      to_pack_.push_back(std::move(make));
  }
  packing_.notify_one();
}

void Swarm::pack_loop() {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), ::getpriority(PRIO_PROCESS, 0) + 5);
  std::unique_lock lock(pack_mutex_);
  while (true) {
    packing_.wait(lock, [&] { return over_ || !to_pack_.empty(); });
    if (over_) return;
    const std::function<void()> make = std::move(to_pack_.front());
    to_pack_.pop_front();
    lock.unlock();
    make();
    lock.lock();
  }
}

SwarmCounts Swarm::counts() {
  const auto now = Clock::now();
  for (const auto& worker : workers_) worker->charge_until(now);
  const std::lock_guard lock(mutex_);
  return std::exchange(counts_, {});
}

}  // namespace candela::scale
