// The push thread: unit's output -> delta -> verdict. See farm_worker.h.
#include <fmt/format.h>

#include <algorithm>
#include <exception>

#include "common/base/enum_names.h"
#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/version.h"
#include "common/wire/wire.h"
#include "worker/service/failure_causes.h"
#include "worker/service/farm_worker.h"

namespace candela::worker {
namespace {

constexpr std::uint32_t kQueueFullMs = 500;  // where the master names no wait

std::string_view text_of(v1::DeltaVerdict verdict) {
  constexpr std::string_view kUnknown = "answered with an unknown verdict";
  return name_of_value<v1::DELTA_VERDICT_JOB_ENDED>(
      {kUnknown, "merged", "dropped, the unit is merged already", "dropped, the lease is not ours any more",
       "refused as corrupt", "refused, the master expects another build", "dropped, the job has ended"},
      verdict, kUnknown);
}

}  // namespace

// A delta that the master's queue had no place for lets others pass: one of an urgent job may have a place
// where that of the unit that was cut short for it has none.
void FarmWorker::push_loop() {
  Lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&]() CANDELA_REQUIRES(mutex_) { return closing_ || !outbox_.empty(); });
    if (closing_) return;
    const auto now = Clock::now();
    const auto due = [&](const auto& finished) {
      return finished->task->dropped ? now : std::max(finished->not_before, now);
    };
    const auto next = std::min_element(outbox_.begin(), outbox_.end(),
                                       [&](const auto& a, const auto& b) { return due(a) < due(b); });
    if (due(*next) > now) {
      changed_.wait_until(lock, due(*next));
      continue;
    }
    std::rotate(outbox_.begin(), next, next + 1);
    const std::shared_ptr<Finished> finished = outbox_.front();
    lock.unlock();
    const bool done = deliver(*finished);
    lock.lock();
    if (done) {
      if (is_full()) next_acquire_ = Clock::now();  // there is a place for units of any priority
      outbox_.pop_front();                          // others come at the end
    }
    changed_.notify_all();
  }
}

bool FarmWorker::deliver(Finished& finished) {
  try {
    if (!finished.header) {
      if (!finished.task->dropped) finished.bytes = encode_delta(finished.info, finished.sums.output);
      finished.sums.output.clear();
      keep_sums(std::move(finished.sums));
    }
    return finished.task->dropped || deliver_bytes(finished);
  } catch (const std::exception& exception) {  // out of memory, most of all
    fail(finished.task, FailureCause::worker,
         fmt::format("cannot encode or send the delta: {}", exception.what()));
    return true;
  }
}

bool FarmWorker::deliver_bytes(Finished& finished) {
  const TaskPtr& task = finished.task;
  const std::string& bytes = finished.bytes;
  const Session session = session_now();
  const log::Ids ids{.job = task->lease.job_id(),
                     .unit = static_cast<std::int64_t>(task->lease.unit_id()),
                     .worker = session.worker_id};
  if (!finished.header) {
    v1::DeltaHeader& header = finished.header.emplace();
    header.set_worker_id(session.worker_id);
    header.set_session(session.token);
    header.set_token(task->lease.token());
    header.set_unit_id(task->lease.unit_id());
    header.set_job_id(task->lease.job_id());
    wire::to_proto(finished.info.unit, *header.mutable_unit());
    header.set_build_id(finished.info.build_id);
    header.set_size_bytes(bytes.size());
    header.set_sha256(sha256_hex(bytes));
    header.set_render_seconds(finished.render_seconds);
    finished.backoff.emplace(tuning_.first_backoff, tuning_.longest_backoff,
                             rng::key(task->lease.token(), 2));
  }
  v1::PushDeltaResponse response;
  task->monitor.steps.fetch_add(1, std::memory_order_relaxed);
  const grpc::Status status =
      link_.push_delta(*finished.header, bytes, session.chunk_bytes, response, task->monitor.steps);
  Milliseconds delay = finished.backoff->next();
  {
    const Lock lock(mutex_);
    if (closing_ || task->dropped) return true;
    note_contact(status);
    if (status.error_code() == grpc::StatusCode::UNAUTHENTICATED) {
      lose_session(task->generation);
      return true;
    }
  }
  if (status.ok()) {
    const bool welcome = response.verdict() == v1::DELTA_VERDICT_MERGED;
    const bool harmless = response.verdict() == v1::DELTA_VERDICT_DUPLICATE ||
                          response.verdict() == v1::DELTA_VERDICT_STALE ||
                          response.verdict() == v1::DELTA_VERDICT_JOB_ENDED;
    std::string line = fmt::format("delta of {} bytes {}", bytes.size(), text_of(response.verdict()));
    if (!response.message().empty()) line += fmt::format(": {}", response.message());
    log::write(welcome ? log::Level::debug : harmless ? log::Level::info : log::Level::error, line, ids);
    task->dropped = true;  // a verdict is final
    return true;
  }
  if (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED) {
    const std::uint32_t told = wire::retry_ms(status, kQueueFullMs);
    // At or a little after the time told, so that the waiting do not come back all at once.
    delay = Milliseconds(told) + std::min(delay, Milliseconds(told / 4 + 1));
    log::debug(fmt::format("the master's queue is full; the delta waits {} ms", delay.count()), ids);
  } else if (!is_unreachable(status)) {
    // Neither a verdict nor a reason to wait. A connection that breaks can look like this once or twice.
    log::warn(fmt::format("delta not taken: {}", wire::from_status(status).message), ids);
    if (status.error_code() == grpc::StatusCode::INVALID_ARGUMENT ||
        ++finished.rejections >= tuning_.max_push_rejections) {
      fail(task, cause_of_delivery(status, FailureCause::worker),
           fmt::format("the master does not take the delta: {}", wire::from_status(status).message));
      return true;
    }
  }
  const Lock lock(mutex_);
  finished.not_before = Clock::now() + delay;
  return false;
}

}  // namespace candela::worker
