// The render thread: lease -> scene -> film. See farm_worker.h.
#include <fmt/format.h>

#include <exception>
#include <new>

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
  std::unique_lock lock(mutex_);
  while (true) {
    // One film may be with the push thread while another is rendered, no more.
    changed_.wait(lock, [&] { return closing_ || (!pending_.empty() && outbox_.size() <= 1); });
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
    if (pending_.empty() && asked_while_busy_) next_acquire_ = Clock::now();
    changed_.notify_all();
  }
}

// No exception leaves the render thread: whatever happens to a unit is reported as its failure.
void FarmWorker::render_task(const TaskPtr& task) {
  try {
    run_task(task);
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
  const bool film = unit->kind == Unit::Kind::iterations || unit->kind == Unit::Kind::segments;
  if (film && !lease.has_named_state())
    return fail(task, FailureCause::worker, "the lease cannot be used: named_state: it is missing");

  const auto scene = scene_for(task, *settings);
  if (!scene || task->stop) return;
  {
    const std::lock_guard lock(mutex_);
    task->started = Clock::now();  // the unit's own time, by which its end is foretold
  }
  switch (unit->kind) {
    case Unit::Kind::pilot:
      return run_pilot(task, *scene);
    case Unit::Kind::bootstrap:
      return run_bootstrap(task, *scene, *unit);
    case Unit::Kind::iterations:
    case Unit::Kind::segments:
      return run_film(task, scene, *unit, *state);
  }
}

// The compiled scene of the lease's job; null if the task was failed or stopped on the way.
std::shared_ptr<const SceneStore::Scene> FarmWorker::scene_for(const TaskPtr& task,
                                                               const JobSettings& settings) {
  const std::string& hash = task->lease.bundle_sha256();
  if (auto scene = scenes_.find(SceneStore::key(hash, settings))) return scene;

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

  const BlobCache::Fetch fetch = [&](const std::string& sha256, std::uint64_t size_bytes,
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
            if (task->stop) return refused_error("stopped");
            delivered += data.size();
            return sink(data);
          },
          sink_error);
    });
    if (!sink_error) return sink_error;
    if (fetched.ok()) return {};
    return fetch_error(fetched, fmt::format("blob {}", sha256));
  };
  const auto begin = Clock::now();
  auto built = scenes_.build(*bundle, settings, fetch);
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
  const auto result = scene.renderer->pilot({threads_, &task->stop, &task->progress});
  if (task->stop) return;
  if (!result) return fail(task, result.error());
  const Session session = session_now();
  v1::CompletePilotRequest request;
  request.set_worker_id(session.worker_id);
  request.set_session(session.token);
  request.set_token(task->lease.token());
  wire::to_proto(result->state, *request.mutable_named_state());
  request.set_plan(result->plan);
  request.set_seconds_per_iteration(result->seconds_per_iteration);
  for (const std::string& layer : result->layers) request.add_layers(layer);
  if (result->chains) wire::to_proto(*result->chains, *request.mutable_chains());
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

void FarmWorker::run_bootstrap(const TaskPtr& task, const SceneStore::Scene& scene, const Unit& unit) {
  std::vector<float> contributions(unit.end - unit.begin);
  const auto begin = Clock::now();
  const auto tallies = scene.renderer->bootstrap(unit.begin, unit.end, contributions,
                                                 {threads_, &task->stop, &task->progress});
  const std::chrono::duration<double> seconds = Clock::now() - begin;
  if (task->stop) return;
  if (!tallies) return fail(task, tallies.error());
  const Session session = session_now();
  v1::CompleteBootstrapRequest request;
  request.set_worker_id(session.worker_id);
  request.set_session(session.token);
  request.set_token(task->lease.token());
  request.mutable_contributions()->Add(contributions.begin(), contributions.end());
  for (std::size_t cause = 0; cause < tallies->rejected.size(); ++cause) {
    if (tallies->rejected[cause] == 0) continue;
    v1::RejectedSamples& rejected = *request.add_rejected();
    rejected.set_cause(std::string(film::name(static_cast<film::RejectCause>(cause))));
    rejected.set_count(tallies->rejected[cause]);
  }
  request.set_render_seconds(seconds.count());
  v1::CompleteBootstrapResponse response;
  const grpc::Status status = persist(task, [&] {
    return link_.unary(MasterLink::Lane::control, &v1::WorkerService::Stub::CompleteBootstrap, request,
                       response, tuning_.call_deadline);
  });
  if (task->dropped) return;
  if (!status.ok())
    return fail(
        task, cause_of_delivery(status, FailureCause::worker),
        fmt::format("the master did not take the bootstrap samples: {}", wire::from_status(status).message));
  log::write(
      response.accepted() ? spdlog::level::debug : spdlog::level::info,
      response.accepted() ? "bootstrap samples done" : "bootstrap samples done, but the lease is another's",
      {.job = task->lease.job_id(),
       .unit = static_cast<std::int64_t>(task->lease.unit_id()),
       .worker = session.worker_id});
  task->dropped = true;  // nothing is left to hand back
}

void FarmWorker::run_film(const TaskPtr& task, const std::shared_ptr<const SceneStore::Scene>& scene,
                          const Unit& unit, const NamedState& state) {
  std::vector<chains::ChainStart> starts;
  std::vector<chains::ChainRecord> records;
  for (const v1::ChainStart& message : task->lease.chain_starts()) {
    auto start = wire::from_proto(message);
    if (!start)
      return fail(task, FailureCause::worker,
                  fmt::format("the lease cannot be used: {}", start.error().to_string()));
    starts.push_back(std::move(*start));
  }
  const bool segments = unit.kind == Unit::Kind::segments;
  if (starts.size() != (segments ? unit.end - unit.begin : 0))
    return fail(task, FailureCause::worker,
                fmt::format("the lease cannot be used: chain_starts: there are {}", starts.size()));

  Film film = take_film(*scene, state);
  const auto begin = Clock::now();
  const render::RunContext context{threads_, &task->stop, &task->progress};
  auto run = segments ? scene->renderer->run_segments(unit, state, starts, *film.film, records, context)
                      : scene->renderer->run(unit, *film.film, context);
  const std::chrono::duration<double> seconds = Clock::now() - begin;
  const bool overflowed = film.film->overflowed();
  if (run && records.size() != starts.size())
    run = internal_error(fmt::format("{} records of {} segments", records.size(), starts.size()));
  if (!run || overflowed) {
    film.film->clear();
    keep_film(std::move(film));
    if (task->stop) return;
    if (!run) return fail(task, run.error());
    // The sums follow from the scene and the unit: they would overflow anywhere.
    return fail(task, FailureCause::scene,
                fmt::format("a film sum overflowed at scale 2^{}", state.film_scale_log2));
  }

  auto finished = std::make_shared<Finished>();
  finished->task = task;
  finished->info.unit = unit;
  finished->info.layout = film.film->layout();
  finished->info.scale_log2 = state.film_scale_log2;
  finished->info.job_id = task->lease.job_id();
  finished->info.build_id = build_id();
  finished->records = std::move(records);
  finished->render_seconds = seconds.count();
  finished->film = std::move(film);
  {
    const std::lock_guard lock(mutex_);
    if (!task->dropped && !closing_) {
      outbox_.push_back(finished);
      running_ = nullptr;  // it is the outbox's now; a draining worker must not hand it back
      changed_.notify_all();
      return;
    }
  }
  finished->film.film->clear();
  keep_film(std::move(finished->film));
}

FarmWorker::Film FarmWorker::take_film(const SceneStore::Scene& scene, const NamedState& state) {
  std::vector<Film> unfit;  // freed outside the lock
  {
    const std::lock_guard lock(mutex_);
    while (!spare_films_.empty()) {
      Film film = std::move(spare_films_.back());
      spare_films_.pop_back();
      if (film.scene_key == scene.key && film.scale_log2 == state.film_scale_log2) return film;
      unfit.push_back(std::move(film));
    }
  }
  unfit.clear();
  return {scene.key, state.film_scale_log2, scene.renderer->make_film(state)};
}

// `film` is clear.
void FarmWorker::keep_film(Film film) {
  const std::lock_guard lock(mutex_);
  if (spare_films_.size() < 2) spare_films_.push_back(std::move(film));
}

void FarmWorker::fail(const TaskPtr& task, const Error& error) {
  fail(task, cause_of_rendering(error), error.to_string());
}

void FarmWorker::fail(const TaskPtr& task, FailureCause cause, const std::string& message) {
  const std::lock_guard lock(mutex_);
  if (task->dropped) return;
  task->dropped = true;
  task->stop = true;
  // A scene that cannot be rendered is its job's trouble, and told there. The rest is an operator's.
  log::write(cause == FailureCause::scene ? spdlog::level::info : spdlog::level::err,
             fmt::format("unit failed ({}): {}", name(cause), message),
             {.job = task->lease.job_id(),
              .unit = static_cast<std::int64_t>(task->lease.unit_id()),
              .worker = session_.worker_id});
  notices_.push_back(
      {task->lease.token(), task->generation, true, cause, message.substr(0, kMaxFailureBytes)});
  changed_.notify_all();
}

bool FarmWorker::pause_for(const TaskPtr& task, Milliseconds delay, bool until_stopped) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, delay,
                            [&] { return closing_ || task->dropped || (until_stopped && task->stop); });
}

grpc::Status FarmWorker::persist(const TaskPtr& task, const std::function<grpc::Status()>& call) {
  Backoff backoff(tuning_.first_backoff, tuning_.longest_backoff, rng::key(task->lease.token(), 1));
  while (true) {
    if (task->stop) return {grpc::StatusCode::CANCELLED, "stopped"};
    const grpc::Status status = call();
    Milliseconds delay = backoff.next();
    {
      const std::lock_guard lock(mutex_);
      note_contact(status);
      if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) lose_session(task->generation);
    }
    if (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED)
      delay = std::max(delay, Milliseconds(wire::retry_ms(status, 0)));
    else if (!is_unreachable(status))
      return status;
    if (!pause_for(task, delay, true)) return {grpc::StatusCode::CANCELLED, "stopped"};
  }
}

}  // namespace candela::worker
