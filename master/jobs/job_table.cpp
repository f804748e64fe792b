#include "master/jobs/job_table.h"

#include <chrono>
#include <new>

#include "common/base/log.h"
#include "common/stats/error_context.h"

namespace candela::master {
namespace {

void log_event(const EventRow& e) {
  std::string text = e.kind;
  if (!e.message.empty()) text += ": " + e.message;
  // Warnings are for the operator. Scene errors are reported to the submitter, not logged as warnings.
  const bool bad = e.kind == "expired" || e.kind == "set-aside" || e.kind == "checkpoint-failed" ||
                   e.kind == "refused" || e.kind == "checkpoint-damaged" || e.kind == "lost" ||
                   e.kind == "orphans" || e.kind == "waiting" || e.kind == "blob-damaged" ||
                   e.kind == "blob-missing" || e.kind == "scene-disputed" || e.kind == "distrusted" ||
                   e.kind == "anew" || e.kind == "tainted";
  log::write(bad ? log::Level::warn : log::Level::info, text, {.job = e.job_id, .worker = e.worker_id});
}

}  // namespace

JobTable::JobTable(std::unique_ptr<Scheduler> scheduler, StoreWriter& writer, std::filesystem::path folder,
                   FileWriter film_writer, SchedulerObserver observer, ChangeListener listener)
    : writer_(writer),
      folder_(std::move(folder)),
      film_writer_(std::move(film_writer)),
      observer_(std::move(observer)),
      listener_(std::move(listener)),
      scheduler_(std::move(scheduler)) {}

Now JobTable::now() {
  using std::chrono::duration;
  return {duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(),
          std::chrono::duration_cast<std::chrono::milliseconds>(
              std::chrono::system_clock::now().time_since_epoch())
              .count()};
}

void JobTable::wait_for(double seconds, const std::function<bool(const Scheduler&)>& holds) {
  Lock lock(mutex_);
  changed_.wait_for(lock, std::chrono::duration<double>(seconds),
                    [&]() CANDELA_REQUIRES(mutex_) { return holds(*scheduler_); });
}

std::shared_ptr<JobFilm> JobTable::make_film(const JobRow& row) const {
  return std::make_shared<JobFilm>(
      folder_of(row.id), layout_of(row), row.named_state->film_scale_log2, film_writer_,
      CheckpointShape{row.chains ? row.chains->chains : 0, row.accumulators, row.epochs,
                      stats::context_of(row.settings.integrator_settings, row.plan).alpha});
}

std::shared_ptr<JobFilm> JobTable::film_of(const std::string& job_id) {
  const Lock lock(mutex_);
  const auto it = films_.find(job_id);
  if (it != films_.end()) return it->second;
  const auto job = scheduler_->jobs().find(job_id);
  if (job == scheduler_->jobs().end() || !job->second.row.named_state) return nullptr;
  return films_[job_id] = make_film(job->second.row);
}

JobFilms JobTable::films() const {
  const Lock lock(mutex_);
  return films_;
}

void JobTable::remember_states(const std::string& job_id, JobFilm& film) {
  for (const StateRow& row : with_scheduler([&](Scheduler& s) { return s.job(job_id)->states; }))
    film.remember({row.name, row.epoch, row.sha256, row.size_bytes});
}

void JobTable::publish() noexcept {
  try {
    if (observer_) observer_(*scheduler_);
    writer_.enqueue(unpublished_);  // of a call that ran out of memory
    unpublished_ = scheduler_->take_changes();
    for (const Change& c : unpublished_)
      if (const auto* e = std::get_if<AddEvent>(&c)) log_event(e->row);
    if (listener_ && !unpublished_.empty()) listener_(*scheduler_, unpublished_);
    writer_.enqueue(unpublished_);
  } catch (const std::bad_alloc&) {
  }
  changed_.notify_all();
}

}  // namespace candela::master
