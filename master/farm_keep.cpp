// The threads that keep a farm: the tick (expiries, hung senders) and the keeper (checkpoints, error
// estimates, images, the last step of a job). Law 6: a job is done when its final checkpoint is on disk, not
// before.
#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/stats/image_error.h"
#include "master/farm.h"

namespace candela::master {
namespace {

constexpr double kTickSeconds = 0.05;
constexpr double kKeepSeconds = 0.1;
constexpr double kRetrySeconds = 1;      // after a checkpoint that failed
constexpr double kImageSeconds = 60;     // between images of a running job
constexpr double kIdleFilmSeconds = 60;  // before the film of a job that has ended gives its memory back
constexpr double kEstimateGrowth = 1.1;  // of iterations between estimates
constexpr double kMinEstimateSeconds = 0.25, kMaxEstimateSeconds = 2;
constexpr double kEstimateShare = 0.05;  // of one thread, at most

}  // namespace

void Farm::sleep(double seconds) {
  std::unique_lock lock(wake_mutex_);
  wake_.wait_for(lock, std::chrono::duration<double>(seconds));
}

void Farm::tick_loop() {
  while (!stopping_) {
    with_scheduler([&](Scheduler& s) { s.tick(now()); });
    gate_->cancel_hung(now().seconds, options_.push_idle_seconds);
    recent_images_.expire(now().seconds);
    std::this_thread::sleep_for(std::chrono::duration<double>(kTickSeconds));
  }
}

void Farm::keep_loop() {
  while (!stopping_) {
    const bool force = flush_requested_.exchange(false);
    std::vector<std::string> ids;
    with_scheduler([&](Scheduler& s) {
      for (const auto& [id, job] : s.jobs()) ids.push_back(id);
    });
    for (const std::string& id : ids) {
      if (stopping_) break;
      const std::lock_guard lock(keep_mutex_);
      keep_job(id, force);
    }
    sleep(kKeepSeconds);
  }
}

bool Farm::save_checkpoint(const std::string& job_id, JobFilm& film) {
  Kept& kept = kept_[job_id];
  kept.last_checkpoint = now().seconds;
  remember_states(job_id, film);
  Result<JobFilm::Checkpoint> written = film.checkpoint();
  // A job without a manifest is as safe as its store: worth an event, and another attempt at the next
  // checkpoint.
  const Result<void> manifest = truth_->keep_manifest(job_id);
  const std::string unwritten = manifest.ok() ? "" : manifest.error().to_string();
  if (!unwritten.empty() && unwritten != kept.manifest_trouble)
    with_scheduler([&](Scheduler& s) { s.event(now(), job_id, "", "manifest-failed", unwritten); });
  kept.manifest_trouble = unwritten;
  if (!written.ok()) {
    ++counters_.checkpoint_failures;
    kept.retry_at = now().seconds + kRetrySeconds;
    const std::string text = written.error().to_string();
    with_scheduler([&](Scheduler& s) {
      // Once per cause: a disk may be full for hours.
      if (kept.trouble != text) s.event(now(), job_id, "", "checkpoint-failed", text);
      s.set_note(job_id,
                 fmt::format("the checkpoint could not be written, trying again; generation {} serves: {}",
                             film.generation(), text));
    });
    kept.trouble = text;
    return false;
  }
  ++counters_.checkpoints;
  with_scheduler([&](Scheduler& s) {
    if (!kept.trouble.empty()) {
      s.event(now(), job_id, "", "checkpoint", "checkpoints can be written again");
      s.set_note(job_id, "");
    }
    s.checkpointed(job_id, written->generation, written->iterations, now());
  });
  kept.trouble.clear();
  kept.retry_at = 0;
  return true;
}

void Farm::estimate(const std::string& job_id, JobFilm& film, bool now_please) {
  Kept& kept = kept_[job_id];
  struct Figures {
    std::uint64_t iterations = 0;
    bool both = false;
  };
  const Figures f = with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(job_id);
    return Figures{job->row.iterations, job->merged[0].count() > 0 && job->merged[1].count() > 0};
  });
  if (!f.both || f.iterations == kept.estimated_iterations) return;
  if (!now_please) {
    const double wait = std::clamp(kept.estimate_cost / kEstimateShare, kMinEstimateSeconds,
                                   std::max(kMaxEstimateSeconds, kept.estimate_cost / kEstimateShare));
    if (now().seconds - kept.last_estimate < wait) return;
    if (static_cast<double>(f.iterations) < kEstimateGrowth * static_cast<double>(kept.estimated_iterations))
      return;
  }
  const double started = now().seconds;
  const JobFilm::Snapshot copy = film.snapshot(JobFilm::Part::image);
  if (!copy.film) return;
  const JobRow row = with_scheduler([&](Scheduler& s) { return s.job(job_id)->row; });
  const stats::ErrorEstimate e = stats::estimate_error(*copy.film, development_of(row, copy.counts));
  kept.last_estimate = now().seconds;
  kept.estimate_cost = kept.last_estimate - started;
  kept.estimated_iterations = copy.film->iterations();
  with_scheduler([&](Scheduler& s) { s.relmse_estimated(job_id, e.relmse, copy.film->iterations(), now()); });
}

// What people are told of a job's chains follows its film within half a second.
void Farm::summarise_chains(const std::string& job_id, JobFilm& film, bool now_please) {
  constexpr double kSummarySeconds = 0.5;
  Kept& kept = kept_[job_id];
  if (!now_please && now().seconds - kept.last_summary < kSummarySeconds) return;
  struct View {
    bool chains = false;
    std::uint64_t iterations = 0;
    chains::BootstrapSums bootstrap;
  };
  const View view = with_scheduler([&](Scheduler& s) {
    const JobRow& row = s.job(job_id)->row;
    return View{row.chains.has_value(), row.iterations, row.bootstrap};
  });
  if (!view.chains || view.iterations == kept.summarised_iterations) return;
  const chains::Summary summary = chains::summarise(view.bootstrap, film.chain_counts());
  kept.last_summary = now().seconds;
  kept.summarised_iterations = view.iterations;
  // Without light for the chains the job is about what needs none, if there is such.
  const bool black = !(view.bootstrap.sum > 0) && film.all_black();
  with_scheduler([&](Scheduler& s) {
    s.chains_summarised(job_id, summary, now());
    if (black) s.found_black(job_id, now());
  });
}

void Farm::write_image(const std::string& job_id, JobFilm& film) {
  Kept& kept = kept_[job_id];
  kept.last_image = now().seconds;
  const JobFilm::Snapshot copy = film.snapshot();
  const JobRow row = with_scheduler([&](Scheduler& s) { return s.job(job_id)->row; });
  if (!copy.film || copy.film->iterations() == 0) return;
  auto bytes = encode_image(row, copy, {});
  Result<void> written = bytes.ok() ? write_file_atomically(job_folder(job_id) / "image.exr", *bytes)
                                    : Result<void>(bytes.error());
  // The film is safe in its checkpoints; an image that cannot be written is worth a line, no more.
  if (!written.ok()) log::warn(fmt::format("no image: {}", written.error().to_string()), {.job = job_id});
}

// One step of care for one job. Precondition: keep_mutex_ is held.
void Farm::keep_job(const std::string& job_id, bool force) {
  struct View {
    bool finishing = false, ended = false, paused = false, has_film = false;
  };
  const View view = with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(job_id);
    return View{job->finishing, has_ended(job->row.state), job->row.state == JobState::paused,
                job->row.named_state.has_value()};
  });
  if (!view.has_film) return;
  const std::shared_ptr<JobFilm> film = film_of(job_id);
  if (!film->loaded()) {
    if (view.ended) return;
    if (auto opened = truth_->open_film(job_id, false); !opened.ok()) return;
  }
  const double t = now().seconds;
  Kept& kept = kept_[job_id];

  if (view.finishing || view.ended) {
    film->close();
    if (t < kept.retry_at) return;
    if (view.finishing) estimate(job_id, *film, true);
    if (film->dirty()) summarise_chains(job_id, *film, true);
    if ((film->dirty() || film->generation() == 0) && !save_checkpoint(job_id, *film)) return;
    if (view.finishing) {
      const bool extended = with_scheduler([&](Scheduler& s) {
        s.finish(job_id, now());
        return !has_ended(s.job(job_id)->row.state);
      });
      film->touch(t);
      if (extended) film->reopen();  // somebody wanted more in the meantime
      wake_.notify_all();
      if (options_.master.image_on_checkpoint) write_image(job_id, *film);
    } else if (force) {
      write_image(job_id, *film);
    }
    film->unload_if_idle(t, kIdleFilmSeconds);
    return;
  }
  film->reopen();
  estimate(job_id, *film, false);
  summarise_chains(job_id, *film, false);
  const bool due = film->dirty() && t >= kept.retry_at &&
                   (force || view.paused || t - kept.last_checkpoint >= options_.master.checkpoint_seconds);
  if (due) save_checkpoint(job_id, *film);
  if (force || (due && options_.master.image_on_checkpoint && t - kept.last_image >= kImageSeconds))
    write_image(job_id, *film);
}

void Farm::flush_images() {
  flush_requested_ = true;
  wake_.notify_all();
}

void Farm::begin_stop() {
  stopping_ = true;
  wake_.notify_all();
}

void Farm::stop() {
  if (stopped_.exchange(true)) return;
  begin_stop();
  for (std::thread& t : threads_)
    if (t.joinable()) t.join();
  threads_.clear();
  if (!writer_) return;  // it never started
  const std::lock_guard lock(keep_mutex_);
  std::map<std::string, std::shared_ptr<JobFilm>> films;
  {
    const std::lock_guard table(mutex_);
    films = films_;
  }
  for (const auto& [id, film] : films) {
    film->close();
    if (film->dirty() && !save_checkpoint(id, *film))
      log::error("the last checkpoint could not be written; the generation before serves at the next start",
                 {.job = id});
  }
  if (auto flushed = writer_->flush(); !flushed.ok())
    log::error(fmt::format("the store could not be written: {}", flushed.error().to_string()));
}

}  // namespace candela::master
