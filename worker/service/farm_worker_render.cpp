// The render thread: lease -> scene -> what the unit brings. See farm_worker.h.
#include <fmt/format.h>

#include <exception>
#include <new>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/version.h"
#include "common/wire/wire.h"
#include "worker/service/failure_causes.h"
#include "worker/service/farm_worker.h"

namespace candela::worker {
namespace {

constexpr std::size_t kMaxFailureBytes = 4096;  // of a message to the master

}  // namespace

void FarmWorker::render_loop() {
  Lock lock(mutex_);
  while (true) {
    // One unit may be with the push thread while another is rendered, and two while an urgent one is.
    changed_.wait(lock, [&]() CANDELA_REQUIRES(mutex_) {
      return closing_ ||
             (!pending_.empty() && outbox_.size() < kMaxDeltas + (pending_.front()->urgent ? 1 : 0));
    });
    if (closing_) return;
    TaskPtr task = std::move(pending_.front());
    pending_.pop_front();
    if (task->dropped) continue;
    task->started = Clock::now();
    running_ = task;
    changed_.notify_all();
    lock.unlock();
    render_task(task);
    lock.lock();
    running_ = nullptr;
    if (task->dropped) beat_soon_ = true;
    if (pending_.empty() && asked_while_busy_) next_acquire_ = Clock::now();
    changed_.notify_all();
  }
}

// No exception leaves the render thread: whatever happens to a unit is reported as its failure.
void FarmWorker::render_task(const TaskPtr& task) {
  const WatchedWork watch(&task->monitor);
  try {
    run_task(task);
  } catch (const WorkStopped&) {  // it is dropped
  } catch (const std::bad_alloc&) {
    fail(task, FailureCause::worker,
         "out of memory (give the worker a machine with more, or other programs there less)");
  } catch (const std::exception& exception) {
    fail(task, FailureCause::worker, fmt::format("the renderer failed: {}", exception.what()));
  }
}

void FarmWorker::run_task(const TaskPtr& task) {
  const v1::Lease& lease = task->lease;
  auto settings = wire::from_proto(lease.settings());
  auto unit = wire::from_proto(lease.unit());
  auto state = wire::from_proto(lease.named_state());
  for (const Error* error : {settings ? nullptr : &settings.error(), unit ? nullptr : &unit.error(),
                             state ? nullptr : &state.error()})
    if (error != nullptr)
      return fail(task, FailureCause::worker,
                  fmt::format("the lease cannot be used: {}", error->to_string()));
  if (makes_film(unit->kind) && !lease.has_named_state())
    return fail(task, FailureCause::worker, "the lease cannot be used: named_state: it is missing");

  const auto scene = scene_for(task, *settings);
  if (!scene || task->dropped) return;
  {
    const Lock lock(mutex_);
    task->started = task->block_started = Clock::now();  // the unit's own time, by which its end is foretold
  }
  if (unit->kind == Unit::Kind::pilot) return run_pilot(task, *scene);
  run_unit(task, *scene, *unit, *state);
}

BlobCache::Fetch FarmWorker::fetch_for(const TaskPtr& task) {
  return [this, task, session = session_now()](const std::string& sha256, std::uint64_t size_bytes,
                                               const BlobCache::Sink& sink) -> Result<void> {
    v1::FetchBlobRequest blob;
    blob.set_worker_id(session.worker_id);
    blob.set_session(session.token);
    blob.set_sha256(sha256);
    blob.set_size_bytes(size_bytes);
    // A transfer that breaks off goes on where it was: the bytes that came are known to the sink already.
    std::uint64_t delivered = 0;
    Result<void> sink_error;
    const grpc::Status fetched = persist(task, [&] {
      blob.set_offset(delivered);
      return link_.fetch_blob(
          blob,
          [&](std::string_view data) -> Result<void> {
            if (task->dropped) return refused_error("stopped");
            task->monitor.steps.fetch_add(1, std::memory_order_relaxed);
            delivered += data.size();
            return sink(data);
          },
          sink_error);
    });
    if (!sink_error) return sink_error;
    if (fetched.ok()) return {};
    return fetch_error(fetched, fmt::format("blob {}", sha256));
  };
}

bool FarmWorker::fetch_states(const TaskPtr& task, render::UnitInput& input,
                              std::vector<BlobCache::Mapped>& owners) {
  const BlobCache::Fetch fetch = fetch_for(task);
  if (!task->lease.states().empty()) work_phase(WorkPhase::fetching);
  for (const v1::DecidedState& state : task->lease.states()) {
    if (!is_sha256_hex(state.sha256()) || state.size_bytes() > Limits::max_blob_bytes) {
      fail(task, FailureCause::worker,
           fmt::format("the lease cannot be used: states: '{}' is not named by a hash", state.name()));
      return false;
    }
    auto mapped = cache_->map(state.sha256(), state.size_bytes(), fetch);
    if (task->dropped) return false;
    if (!mapped) {
      fail(task, cause_of_fetching(mapped.error()),
           fmt::format("state '{}': {}", state.name(), mapped.error().to_string()));
      return false;
    }
    input.states[state.name()] = mapped->bytes;
    owners.push_back(std::move(*mapped));
  }
  return true;
}

// The compiled scene of the lease's job; null if the task was failed or stopped on the way.
std::shared_ptr<const SceneStore::Scene> FarmWorker::scene_for(const TaskPtr& task,
                                                               const JobSettings& settings) {
  const std::string& hash = task->lease.bundle_sha256();
  if (auto scene = scenes_.find(SceneStore::key(hash, settings))) return scene;

  work_phase(WorkPhase::fetching);
  const Session session = session_now();
  v1::GetBundleRequest request;
  request.set_worker_id(session.worker_id);
  request.set_session(session.token);
  request.set_bundle_sha256(hash);
  v1::Bundle message;
  const grpc::Status status = persist(task, [&] {
    return link_.unary(MasterLink::Lane::fetch, &v1::WorkerService::Stub::GetBundle, request, message,
                       4 * tuning_.call_deadline);
  });
  if (!status.ok()) {
    const Error error = fetch_error(status, fmt::format("bundle {}", hash));
    fail(task, cause_of_fetching(error), error.to_string());
    return nullptr;
  }
  auto bundle = wire::from_proto(message);
  if (!bundle) {
    fail(task, FailureCause::network,
         fmt::format("bundle {} cannot be used: {}", hash, bundle.error().to_string()));
    return nullptr;
  }
  if (bundle->hash() != hash) {
    fail(task, FailureCause::network, fmt::format("the master sent another bundle for {}", hash));
    return nullptr;
  }

  const auto begin = Clock::now();
  auto built = scenes_.build(*bundle, settings, fetch_for(task));
  if (auto* failure = std::get_if<SceneStore::Failure>(&built)) {
    fail(task, failure->cause, failure->error.to_string());
    return nullptr;
  }
  const std::chrono::duration<double> seconds = Clock::now() - begin;
  log::info(fmt::format("scene of {} files ready after {:.2f} s", bundle->files.size(), seconds.count()),
            {.job = task->lease.job_id(), .worker = session.worker_id});
  return std::get<0>(std::move(built));
}

void FarmWorker::run_pilot(const TaskPtr& task, const SceneStore::Scene& scene) {
  work_phase(WorkPhase::piloting);
  const auto result =
      scene.renderer->pilot({threads_, &task->monitor.stop, &task->progress, &task->monitor.steps});
  if (task->dropped) return;
  if (!result) return fail(task, result.error());
  const Session session = session_now();
  v1::CompletePilotRequest request;
  request.set_worker_id(session.worker_id);
  request.set_session(session.token);
  request.set_token(task->lease.token());
  wire::to_proto(result->state, *request.mutable_named_state());
  request.set_plan(result->plan);
  request.set_seconds_per_iteration(result->seconds_per_iteration);
  wire::to_proto(result->work, *request.mutable_work());
  v1::CompletePilotResponse response;
  const grpc::Status status = persist(task, [&] {
    return link_.unary(MasterLink::Lane::control, &v1::WorkerService::Stub::CompletePilot, request, response,
                       tuning_.call_deadline);
  });
  if (task->dropped) return;
  if (!status.ok())
    // The pilot's result follows from the scene: one that cannot be is the same on any worker.
    return fail(
        task, cause_of_delivery(status, FailureCause::scene),
        fmt::format("the master did not take the pilot's result: {}", wire::from_status(status).message));
  log::info(response.accepted() ? "pilot done" : "pilot done, but the lease is another's",
            {.job = task->lease.job_id(),
             .unit = static_cast<std::int64_t>(task->lease.unit_id()),
             .worker = session.worker_id});
  task->dropped = true;  // nothing is left to hand back
}

Result<void> FarmWorker::run_blocks(const TaskPtr& task, const SceneStore::Scene& scene,
                                    const render::UnitInput& input, Unit& unit, render::UnitOutput& output) {
  render::RunContext context{threads_, &task->monitor.stop, &task->progress, &task->monitor.steps};
  const auto whole = static_cast<double>(unit.end - unit.begin);
  const auto tell_if_cut = [&](const char* noun) {
    const auto done = static_cast<double>(unit.end - unit.begin);
    if (done < whole)
      log::info(fmt::format("unit cut short after {} of {} {}", done, whole, noun),
                {.job = task->lease.job_id(), .unit = static_cast<std::int64_t>(task->lease.unit_id())});
  };
  if (unit.kind == Unit::Kind::segments) {
    // A block of few segments would leave threads without work, so the renderer itself ends early.
    context.cut = &task->cut;
    CANDELA_TRY(scene.renderer->run(unit, input, output, context));
    const std::size_t done = output.records.size();
    if (done == 0 || done > input.starts.size())
      return internal_error(fmt::format("{} records of {} segments", done, input.starts.size()));
    unit.end = unit.begin + done;
    tell_if_cut("segments");
    return {};
  }
  // Samples of a bootstrap are soon done: those units are whole.
  if (unit.kind != Unit::Kind::iterations) return scene.renderer->run(unit, input, output, context);
  const double block_seconds = std::chrono::duration<double>(tuning_.block).count();
  double per_iteration = task->lease.expected_seconds() / whole;  // 0: unknown
  std::uint64_t at = unit.begin;
  const auto begin = Clock::now();
  while (at < unit.end && (at == unit.begin || !task->cut)) {
    const double fits = per_iteration > 0 ? block_seconds / per_iteration : 1;
    const auto size = static_cast<std::uint64_t>(std::clamp(fits, 1.0, static_cast<double>(unit.end - at)));
    {
      const Lock lock(mutex_);
      task->block_started = Clock::now();
      task->before_block = static_cast<double>(at - unit.begin) / whole;
      task->of_block = static_cast<double>(size) / whole;
      task->progress = 0;
    }
    work_step();
    CANDELA_TRY(scene.renderer->run({unit.kind, unit.half, at, at + size}, input, output, context));
    at += size;
    const std::chrono::duration<double> spent = Clock::now() - begin;
    per_iteration = spent.count() / static_cast<double>(at - unit.begin);
  }
  unit.end = at;
  tell_if_cut("iterations");
  return {};
}

void FarmWorker::run_unit(const TaskPtr& task, const SceneStore::Scene& scene, const Unit& leased,
                          const NamedState& state) {
  Unit unit = leased;
  std::vector<chains::ChainStart> starts;
  for (const v1::ChainStart& message : task->lease.chain_starts()) {
    auto start = wire::from_proto(message);
    if (!start)
      return fail(task, FailureCause::worker,
                  fmt::format("the lease cannot be used: {}", start.error().to_string()));
    starts.push_back(std::move(*start));
  }
  if (starts.size() != (unit.kind == Unit::Kind::segments ? unit.end - unit.begin : 0))
    return fail(task, FailureCause::worker,
                fmt::format("the lease cannot be used: chain_starts: there are {}", starts.size()));

  render::UnitInput input;
  input.state = state;
  input.starts = starts;
  std::vector<BlobCache::Mapped> states;
  if (!fetch_states(task, input, states)) return;
  Sums sums = take_sums(scene, unit, state);
  render::UnitOutput& output = sums.output;
  const auto begin = Clock::now();
  work_phase(WorkPhase::rendering);
  auto run = run_blocks(task, scene, input, unit, output);
  const std::chrono::duration<double> seconds = Clock::now() - begin;
  const bool overflowed = output.overflowed();
  const std::uint64_t samples = unit.kind == Unit::Kind::bootstrap ? unit.end - unit.begin : 0;
  if (run && output.table.size() != samples)
    run = internal_error(fmt::format("a table of {} for {} samples", output.table.size(), samples));
  if (!run || overflowed) {
    output.clear();
    keep_sums(std::move(sums));
    if (task->dropped) return;
    // The sums follow from the scene and the unit: they would overflow anywhere.
    if (overflowed)
      return fail(task, FailureCause::scene,
                  fmt::format("a sum overflowed, at a film scale of 2^{}", state.film_scale_log2));
    return fail(task, run.error());
  }

  auto finished = std::make_shared<Finished>();
  finished->task = task;
  finished->info.unit = unit;
  finished->info.job_id = task->lease.job_id();
  finished->info.build_id = build_id();
  finished->render_seconds = seconds.count();
  finished->sums = std::move(sums);
  {
    const Lock lock(mutex_);
    if (!task->dropped && !closing_) {
      task->monitor.phase = WorkPhase::pushing;
      outbox_.push_back(finished);
      running_ = nullptr;  // it is the outbox's now; a draining worker must not hand it back
      changed_.notify_all();
      return;
    }
  }
  finished->sums.output.clear();
  keep_sums(std::move(finished->sums));
}

FarmWorker::Sums FarmWorker::take_sums(const SceneStore::Scene& scene, const Unit& unit,
                                       const NamedState& state) {
  if (!makes_film(unit.kind)) return {};
  std::vector<Sums> unfit;  // freed outside the lock
  {
    const Lock lock(mutex_);
    while (!spare_sums_.empty()) {
      Sums sums = std::move(spare_sums_.back());
      spare_sums_.pop_back();
      if (sums.scene_key == scene.key && sums.state == state) return sums;
      unfit.push_back(std::move(sums));
    }
  }
  unfit.clear();
  return {scene.key, state, scene.renderer->make_output(state)};
}

// Precondition: the sums are clear.
void FarmWorker::keep_sums(Sums sums) {
  if (sums.output.film == nullptr) return;
  const Lock lock(mutex_);
  if (spare_sums_.size() < 2) spare_sums_.push_back(std::move(sums));
}

void FarmWorker::fail(const TaskPtr& task, const Error& error) {
  fail(task, cause_of_rendering(error), error.to_string());
}

void FarmWorker::fail(const TaskPtr& task, FailureCause cause, const std::string& message) {
  const Lock lock(mutex_);
  if (task->dropped) return;
  task->dropped = true;
  task->stopped_at = Clock::now();
  task->monitor.stop = true;
  // A scene that cannot be rendered is its job's trouble, and told there. The rest is an operator's.
  log::write(cause == FailureCause::scene ? log::Level::info : log::Level::error,
             fmt::format("unit failed ({}): {}", name(cause), message),
             {.job = task->lease.job_id(),
              .unit = static_cast<std::int64_t>(task->lease.unit_id()),
              .worker = session_.worker_id});
  notices_.push_back(
      {task->lease.token(), task->generation, true, false, cause, message.substr(0, kMaxFailureBytes)});
  changed_.notify_all();
}

bool FarmWorker::pause_for(const TaskPtr& task, Milliseconds delay) {
  Lock lock(mutex_);
  return !changed_.wait_for(lock, delay,
                            [&]() CANDELA_REQUIRES(mutex_) { return closing_ || task->dropped; });
}

grpc::Status FarmWorker::persist(const TaskPtr& task, const std::function<grpc::Status()>& call) {
  Backoff backoff(tuning_.first_backoff, tuning_.longest_backoff, rng::key(task->lease.token(), 1));
  while (true) {
    if (task->dropped) return {grpc::StatusCode::CANCELLED, "stopped"};
    const grpc::Status status = call();
    Milliseconds delay = backoff.next();
    {
      const Lock lock(mutex_);
      note_contact(status);
      if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) lose_session(task->generation);
    }
    if (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED)
      delay = std::max(delay, Milliseconds(wire::retry_ms(status, 0)));
    else if (!is_unreachable(status))
      return status;
    task->monitor.steps.fetch_add(1, std::memory_order_relaxed);
    if (!pause_for(task, delay)) return {grpc::StatusCode::CANCELLED, "stopped"};
  }
}

}  // namespace candela::worker
