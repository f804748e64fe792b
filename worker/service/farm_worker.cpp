// Control and heartbeat: registration, leases, reports, draining. See farm_worker.h.
#include "worker/service/farm_worker.h"

#include <fmt/format.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/base/text.h"
#include "common/base/version.h"
#include "common/wire/wire.h"
#include "worker/service/resident_memory.h"

namespace candela::worker {
namespace {

constexpr Milliseconds kShortestRetry{10};
constexpr Milliseconds kLongestRetry{10000};
constexpr Milliseconds kControlTick{200};  // how late give-up and drain limits may be noticed
constexpr std::uint32_t kLongestHeartbeatMs = 60000;

// Cores this process may use, which a batch system may have made fewer than the machine's.
unsigned usable_cores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (::sched_getaffinity(0, sizeof set, &set) == 0)
    return static_cast<unsigned>(std::max(1, CPU_COUNT(&set)));
  return std::max(1U, std::thread::hardware_concurrency());
}

std::string host_name() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0 || name[0] == '\0') return "unknown";
  return escape_unprintable(name.data());
}

std::uint64_t machine_memory_bytes() {
  return static_cast<std::uint64_t>(std::max(0L, ::sysconf(_SC_PHYS_PAGES))) *
         static_cast<std::uint64_t>(std::max(0L, ::sysconf(_SC_PAGESIZE)));
}

std::uint64_t jitter_seed() {
  return rng::key(static_cast<std::uint64_t>(::getpid()),
                  static_cast<std::uint64_t>(std::chrono::system_clock::now().time_since_epoch().count()));
}

// A refusal that asking again cannot change.
bool is_final_refusal(const grpc::Status& status) {
  switch (status.error_code()) {
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::PERMISSION_DENIED:
    case grpc::StatusCode::UNIMPLEMENTED:
      return true;
    default:
      return false;
  }
}

}  // namespace

Result<std::unique_ptr<Worker>> FarmWorker::start(const WorkerOptions& options,
                                                  std::shared_ptr<grpc::Channel> channel,
                                                  RendererFactory factory, const Tuning& tuning) {
  CANDELA_ASSIGN(std::unique_ptr<BlobCache> cache,
                 BlobCache::open(options.cache_dir, options.cache_limit_bytes, options.blobs_beside));
  auto worker = std::unique_ptr<FarmWorker>(
      new FarmWorker(options, std::move(channel), std::move(factory), std::move(cache), tuning));
  FarmWorker& w = *worker;
  w.heartbeat_thread_ = std::thread([&w] { w.heartbeat_loop(); });
  w.render_thread_ = std::thread([&w] { w.render_loop(); });
  w.push_thread_ = std::thread([&w] { w.push_loop(); });
  w.control_thread_ = std::thread([&w] { w.control_loop(); });
  return std::unique_ptr<Worker>(std::move(worker));
}

FarmWorker::FarmWorker(const WorkerOptions& options, std::shared_ptr<grpc::Channel> channel,
                       RendererFactory factory, std::unique_ptr<BlobCache> cache, const Tuning& tuning)
    : options_(options),
      tuning_(tuning),
      threads_(options.threads > 0 ? options.threads : usable_cores()),
      host_(host_name()),
      name_(options.name.empty() ? host_ : options.name),
      factory_(std::move(factory)),
      cache_(std::move(cache)),
      scenes_(factory_, *cache_, threads_, tuning.max_scenes,
              options.scene_memory_bytes > 0 ? options.scene_memory_bytes : machine_memory_bytes() / 2),
      link_(std::move(channel)),
      control_backoff_(tuning.first_backoff, tuning.longest_backoff, jitter_seed()) {}

FarmWorker::~FarmWorker() {
  drain();
  for (std::thread* thread : {&control_thread_, &heartbeat_thread_, &render_thread_, &push_thread_})
    if (thread->joinable()) thread->join();
}

void FarmWorker::drain() {
  {
    const Lock lock(mutex_);
    if (drain_ == Drain::by_us || closing_) return;
    drain_ = Drain::by_us;
    drain_started_ = Clock::now();
    running_settled_ = false;
  }
  link_.close(MasterLink::Lane::registration);
  changed_.notify_all();
}

Result<void> FarmWorker::wait() {
  Lock lock(mutex_);
  changed_.wait(lock, [&]() CANDELA_REQUIRES(mutex_) { return ended_; });
  if (end_error_) return *end_error_;
  return {};
}

FarmWorker::Session FarmWorker::session_now() const {
  const Lock lock(mutex_);
  return session_;
}

// ---- control
// ---------------------------------------------------------------------------------------------------------

void FarmWorker::control_loop() {
  Lock lock(mutex_);
  while (!end_error_) {
    give_up_if_due();
    settle_cut();
    if (is_stuck()) break;
    if (end_error_ || (drain_ != Drain::no && step_drain())) break;
    if (session_.generation == 0) {
      register_once(lock);
    } else if (!notices_.empty()) {
      send_notice(lock);
    } else if (wants_lease() && Clock::now() >= next_acquire_) {
      acquire_once(lock);
    } else {
      const auto tick = Clock::now() + kControlTick;
      const bool idle = wants_lease();
      changed_.wait_until(lock, idle ? std::min(tick, next_acquire_) : tick);
    }
  }
  leave(lock);
}

// The time without a master is counted from the first unanswered call since the last
// answer.
void FarmWorker::note_contact(const grpc::Status& status) {
  if (!is_unreachable(status)) {
    unreachable_since_.reset();
  } else if (!unreachable_since_) {
    unreachable_since_ = Clock::now();
    log::warn(fmt::format("the master does not answer: {}", wire::from_status(status).message),
              {.worker = session_.worker_id});
  }
}

void FarmWorker::give_up_if_due() {
  if (options_.give_up_seconds <= 0 || !unreachable_since_) return;
  const std::chrono::duration<double> away = Clock::now() - *unreachable_since_;
  if (away.count() < options_.give_up_seconds) return;
  end_with(unreachable_error(fmt::format("the master did not answer for {:.0f} s", away.count()))
               .with_mend("see whether it runs and whether --master names it"));
}

void FarmWorker::end_with(Error error) {
  if (!end_error_) end_error_ = std::move(error);
  changed_.notify_all();
}

void FarmWorker::register_once(Lock& lock) {
  v1::RegisterRequest request;
  request.set_protocol(kProtocol);
  request.set_build_id(std::string(build_id()));
  request.set_name(name_.substr(0, Limits::max_name_bytes));
  request.set_host(host_);
  request.set_threads(threads_);
  for (std::string& isa : factory_.supported_isas()) request.add_isas(std::move(isa));
  request.set_memory_bytes(machine_memory_bytes());
  v1::RegisterResponse response;
  const grpc::Status status = lock.without([&] {
    return link_.unary(MasterLink::Lane::registration, &v1::WorkerService::Stub::Register, request, response,
                       tuning_.register_deadline);
  });
  note_contact(status);
  if (status.ok() && !response.worker_id().empty() && !response.session().empty()) {
    session_ = {};
    session_.worker_id = response.worker_id();
    session_.token = response.session();
    session_.generation = ++generations_;
    session_.heartbeat =
        Milliseconds(std::clamp<std::uint32_t>(response.heartbeat_ms(), 10, kLongestHeartbeatMs));
    if (response.max_chunk_bytes() > 0)
      session_.chunk_bytes =
          std::clamp<std::size_t>(response.max_chunk_bytes(), 4096, Limits::max_chunk_bytes);
    next_acquire_ = Clock::now();
    control_backoff_.reset();
    log::info(fmt::format("registered as '{}' with {} threads", name_, threads_),
              {.worker = session_.worker_id});
    changed_.notify_all();
    return;
  }
  if (is_final_refusal(status)) {
    Error error = wire::from_status(status);
    error.message = fmt::format("the master refuses this worker: {}", error.message);
    return end_with(std::move(error));
  }
  if (drain_ != Drain::no) return;
  if (!is_unreachable(status))
    log::warn(status.ok() ? "the master registered this worker without a name"
                          : fmt::format("cannot register: {}", wire::from_status(status).message));
  changed_.wait_for(lock, control_backoff_.next(),
                    [&]() CANDELA_REQUIRES(mutex_) { return drain_ != Drain::no || end_error_; });
}

void FarmWorker::acquire_once(Lock& lock) {
  const Session session = session_;
  asked_while_busy_ = running_ != nullptr;
  const bool full = is_full();
  v1::AcquireLeaseRequest request;
  request.set_worker_id(session.worker_id);
  request.set_session(session.token);
  request.set_prefetch(asked_while_busy_);
  request.set_full(full);
  v1::AcquireLeaseResponse response;
  const grpc::Status status = lock.without([&] {
    for (std::string& hash : scenes_.warm_bundles()) request.add_warm_bundles(std::move(hash));
    return link_.unary(MasterLink::Lane::control, &v1::WorkerService::Stub::AcquireLease, request, response,
                       tuning_.call_deadline);
  });
  note_contact(status);
  if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) return lose_session(session.generation);
  if (!status.ok()) {
    if (!is_unreachable(status))
      log::warn(fmt::format("no lease: {}", wire::from_status(status).message),
                {.worker = session.worker_id});
    next_acquire_ = Clock::now() + control_backoff_.next();
    return;
  }
  control_backoff_.reset();
  if (response.drain() && drain_ == Drain::no) {
    log::info("the master drains this worker", {.worker = session.worker_id});
    drain_ = Drain::by_master;
    drain_started_ = Clock::now();
  }
  const bool current = session.generation == session_.generation;
  if (response.has_lease() && current && !owns(response.lease().token())) {
    auto task = std::make_shared<Task>();
    task->lease = std::move(*response.mutable_lease());
    task->generation = session.generation;
    task->urgent = full;
    if (drain_ == Drain::no)
      pending_.push_back(std::move(task));
    else
      hand_back(task);
    // The next one is wanted when this one is being rendered.
    next_acquire_ = Clock::now();
  } else {
    next_acquire_ =
        Clock::now() + std::clamp(Milliseconds(response.retry_ms()), kShortestRetry, kLongestRetry);
    // It has become idle while it asked as a busy one, or has a place while it asked as a full one: ask
    // again.
    if ((asked_while_busy_ && running_ == nullptr) || (full && !is_full())) next_acquire_ = Clock::now();
  }
  changed_.notify_all();
}

// None while a unit is computed that the worker does not own any more.
bool FarmWorker::wants_lease() const {
  return drain_ == Drain::no && pending_.empty() && (outbox_.size() < kMaxDeltas || is_full()) &&
         (running_ == nullptr || !running_->dropped);
}

bool FarmWorker::is_full() const {
  return outbox_.size() == kMaxDeltas && running_ == nullptr;
}

bool FarmWorker::owns(std::uint64_t token) const {
  const auto is = [token](const TaskPtr& task) { return task != nullptr && task->lease.token() == token; };
  return is(running_) || std::any_of(pending_.begin(), pending_.end(), is) ||
         std::any_of(outbox_.begin(), outbox_.end(),
                     [&](const auto& finished) { return is(finished->task); });
}

void FarmWorker::send_notice(Lock& lock) {
  const Notice notice = notices_.front();
  const Session session = session_;
  if (notice.generation != session.generation) {  // void with the session it belonged to
    notices_.pop_front();
    return;
  }
  const grpc::Status status = lock.without([&] {
    if (notice.failed) {
      v1::FailUnitRequest request;
      request.set_worker_id(session.worker_id);
      request.set_session(session.token);
      request.set_token(notice.token);
      request.set_message(escape_unprintable(notice.message));  // a string of the wire is UTF-8
      request.set_cause(wire::to_proto(notice.cause));
      v1::FailUnitResponse response;
      return link_.unary(MasterLink::Lane::control, &v1::WorkerService::Stub::FailUnit, request, response,
                         tuning_.call_deadline);
    }
    v1::ReturnLeaseRequest request;
    request.set_worker_id(session.worker_id);
    request.set_session(session.token);
    request.set_token(notice.token);
    request.set_computing(notice.computing);
    v1::ReturnLeaseResponse response;
    return link_.unary(MasterLink::Lane::control, &v1::WorkerService::Stub::ReturnLease, request, response,
                       tuning_.call_deadline);
  });
  note_contact(status);
  if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) return lose_session(session.generation);
  if (is_unreachable(status) || status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED) {
    const bool draining = drain_ == Drain::by_us;
    changed_.wait_for(lock, control_backoff_.next(), [&]() CANDELA_REQUIRES(mutex_) {
      return end_error_ || (!draining && drain_ == Drain::by_us);
    });
    return;
  }
  control_backoff_.reset();
  if (!status.ok())
    log::warn(
        fmt::format("the master did not take the report on a unit: {}", wire::from_status(status).message),
        {.worker = session.worker_id});
  if (!notices_.empty() && notices_.front().token == notice.token) notices_.pop_front();
}

// Drops all that the worker holds: the master knows the session no more.
void FarmWorker::lose_session(std::uint64_t generation) {
  if (generation != session_.generation) return;
  log::warn("the master does not know this session any more; registering again",
            {.worker = session_.worker_id});
  session_ = {};
  if (running_) drop(*running_, "its session is gone");
  for (const TaskPtr& task : pending_) drop(*task, "its session is gone");
  pending_.clear();
  for (const auto& finished : outbox_) drop(*finished->task, "its session is gone");
  notices_.clear();
  changed_.notify_all();
}

void FarmWorker::drop(Task& task, std::string_view why) {
  if (task.dropped.exchange(true)) return;
  task.stopped_at = Clock::now();
  task.monitor.stop = true;
  // Calls that wait for the master may end.
  if (running_.get() == &task) link_.interrupt(MasterLink::Lane::fetch);
  if (!outbox_.empty() && outbox_.front()->task.get() == &task) link_.interrupt(MasterLink::Lane::push);
  log::info(fmt::format("unit dropped: {}", why), {.job = task.lease.job_id(),
                                                   .unit = static_cast<std::int64_t>(task.lease.unit_id()),
                                                   .worker = session_.worker_id});
}

void FarmWorker::hand_back(const TaskPtr& task) {
  if (task->dropped) return;
  drop(*task, "handed back");
  notices_.push_back(
      {task->lease.token(), task->generation, false, task == running_, FailureCause::worker, {}});
  changed_.notify_all();
}

// ---- units cut short
// ---------------------------------------------------------------------------------------------------------

// Returns the seconds until the iterations or segments under way end, by their progress; none: not known.
std::optional<double> FarmWorker::seconds_left(const Task& task) const {
  const double done = task.progress;
  if (task.phase() != WorkPhase::rendering || !(done > 0)) return std::nullopt;
  const std::chrono::duration<double> spent = Clock::now() - task.block_started;
  const double left = spent.count() * std::max(1 - done, 0.0) / done;
  if (task.lease.unit().kind() != v1::Unit::KIND_SEGMENTS) return left;
  // A cut unit of segments ends the segments under way, one on each thread.
  const auto count = static_cast<double>(task.lease.chain_starts_size());
  return std::min(left, spent.count() / done * std::min<double>(threads_, count) / count);
}

// A unit that has not begun to render goes back at once.
void FarmWorker::cut_short(const TaskPtr& task) {
  if (task->dropped || task->cut_at) return;
  if (task != running_ || task->phase() != WorkPhase::rendering) return hand_back(task);
  task->cut_at = Clock::now();
  task->cut = true;
}

// The unit under way ends after this iteration. One that takes long to end is given back
// whole, if less work is lost than would be waited for.
void FarmWorker::settle_cut() {
  if (!running_ || running_->dropped || !running_->cut_at) return;
  const std::chrono::duration<double> within = tuning_.cut_within;
  const std::chrono::duration<double> spent = Clock::now() - running_->started;
  const std::optional<double> left = seconds_left(*running_);
  if (left ? *left > within.count() && spent.count() < *left : Clock::now() - *running_->cut_at > within)
    hand_back(running_);
}

// True if the renderer was told to stop and does not; finished units have been delivered, if
// the master takes them in time.
bool FarmWorker::is_stuck() {
  if (!running_ || !running_->stopped_at) return false;
  const auto since = Clock::now() - *running_->stopped_at;
  if (since < tuning_.stop_limit) return false;
  if (!stuck_)
    log::error(
        fmt::format("the renderer does not stop {}; the worker begins again", doing(running_->phase())),
        {.job = running_->lease.job_id(), .worker = session_.worker_id});
  stuck_ = true;
  for (const TaskPtr& task : pending_) hand_back(task);
  pending_.clear();
  return (outbox_.empty() && notices_.empty()) || since > 2 * tuning_.stop_limit;
}

bool FarmWorker::must_begin_again() const {
  const Lock lock(mutex_);
  return stuck_ && drain_ == Drain::no;
}

// ---- leaving
// ---------------------------------------------------------------------------------------------------------

// True when there is nothing left to wait for.
bool FarmWorker::step_drain() {
  for (const TaskPtr& task : pending_) hand_back(task);
  pending_.clear();
  const auto now = Clock::now();
  if (running_ && !running_->dropped && !running_->cut_at) cut_short(running_);
  if (drain_ == Drain::by_us && running_ && !running_->dropped) {
    bool finish = running_settled_ && now - drain_started_ < 2 * tuning_.finish_within;
    if (!running_settled_) {
      running_settled_ = true;
      const std::optional<double> left = seconds_left(*running_);
      finish = left && *left < std::chrono::duration<double>(tuning_.finish_within).count();
    }
    if (!finish) hand_back(running_);
  }
  const bool rendering = running_ != nullptr && !running_->dropped;
  // Handing back to a master that is away is not worth waiting for: the leases expire.
  const bool told = notices_.empty() || (drain_ == Drain::by_us && unreachable_since_);
  const bool done = !rendering && outbox_.empty() && told;
  const bool late = drain_ == Drain::by_us && now - drain_started_ > tuning_.drain_limit;
  // Without a session there is nobody to deliver to, and what there was is void.
  return done || late || (session_.generation == 0 && drain_ == Drain::by_us && !rendering);
}

void FarmWorker::leave(Lock& lock) {
  closing_ = true;
  if (running_) drop(*running_, "the worker leaves");
  const Session session = session_;
  const bool reachable = !unreachable_since_;
  lock.without([&] {
    changed_.notify_all();
    link_.close(MasterLink::Lane::registration);
    link_.close(MasterLink::Lane::fetch);
    link_.close(MasterLink::Lane::push);
    link_.close(MasterLink::Lane::heartbeat);
    // Deregister hands back whatever the master still counts as ours. To a master that is away it is not even
    // said: the leases expire.
    if (session.generation != 0 && reachable) {
      v1::DeregisterRequest request;
      request.set_worker_id(session.worker_id);
      request.set_session(session.token);
      v1::DeregisterResponse response;
      const grpc::Status status = link_.unary(MasterLink::Lane::control, &v1::WorkerService::Stub::Deregister,
                                              request, response, tuning_.farewell_deadline);
      if (!status.ok())
        log::warn(fmt::format("left without a farewell: {}", wire::from_status(status).message),
                  {.worker = session.worker_id});
    }
  });
  log::info("the worker has left", {.worker = session.worker_id});
  ended_ = true;
  changed_.notify_all();
}

// ---- heartbeat
// -------------------------------------------------------------------------------------------------------

void FarmWorker::heartbeat_loop() {
  Lock lock(mutex_);
  while (!closing_) {
    if (session_.generation == 0) {
      changed_.wait(lock, [&]() CANDELA_REQUIRES(mutex_) { return closing_ || session_.generation != 0; });
      continue;
    }
    const Session session = session_;
    const auto next = Clock::now() + session.heartbeat;
    v1::HeartbeatRequest request;
    request.set_worker_id(session.worker_id);
    request.set_session(session.token);
    request.set_resident_bytes(resident_bytes());
    const auto add = [&](const Task& task, double fraction) {
      v1::UnitProgress& unit = *request.add_units();
      unit.set_token(task.lease.token());
      unit.set_fraction(fraction);
      unit.set_phase(wire::to_proto(task.phase()));
      unit.set_steps(task.monitor.steps);
    };
    beat_soon_ = false;
    if (running_) add(*running_, running_->fraction());
    for (const TaskPtr& task : pending_)
      if (!task->dropped) add(*task, 0);
    for (const auto& finished : outbox_)
      if (!finished->task->dropped) add(*finished->task, 1);
    lock.unlock();
    v1::HeartbeatResponse response;
    const grpc::Status status = link_.unary(MasterLink::Lane::heartbeat, &v1::WorkerService::Stub::Heartbeat,
                                            request, response, tuning_.call_deadline);
    lock.lock();
    if (closing_) break;
    note_contact(status);
    if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) {
      lose_session(session.generation);
      continue;
    }
    if (status.ok() && session.generation == session_.generation) {
      const auto revoked = [&](const Task& task) {
        const auto& tokens = response.revoked_tokens();
        return std::find(tokens.begin(), tokens.end(), task.lease.token()) != tokens.end();
      };
      if (running_ && revoked(*running_)) drop(*running_, "revoked by the master");
      for (const TaskPtr& task : pending_)
        if (revoked(*task)) drop(*task, "revoked by the master");
      std::erase_if(pending_, [](const TaskPtr& task) { return task->dropped.load(); });
      for (const auto& finished : outbox_)
        if (revoked(*finished->task)) drop(*finished->task, "revoked by the master");
      const auto to_cut = [&](const TaskPtr& task) {
        const auto& tokens = response.cut_tokens();
        return std::find(tokens.begin(), tokens.end(), task->lease.token()) != tokens.end();
      };
      if (running_ && to_cut(running_)) cut_short(running_);
      for (const TaskPtr& task : pending_)
        if (to_cut(task)) cut_short(task);
      std::erase_if(pending_, [](const TaskPtr& task) { return task->dropped.load(); });
      if (response.heartbeat_ms() > 0)
        session_.heartbeat =
            Milliseconds(std::clamp<std::uint32_t>(response.heartbeat_ms(), 10, kLongestHeartbeatMs));
      if (response.drain() && drain_ == Drain::no) {
        log::info("the master drains this worker", {.worker = session.worker_id});
        drain_ = Drain::by_master;
        drain_started_ = Clock::now();
      }
      changed_.notify_all();
    }
    changed_.wait_until(lock, next, [&]() CANDELA_REQUIRES(mutex_) {
      return closing_ || beat_soon_ || session_.generation != session.generation;
    });
  }
}

}  // namespace candela::worker
