#include "master/jobs/job_upkeep.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/base/log.h"
#include "common/stats/error_context.h"
#include "master/jobs/convergence.h"
#include "master/jobs/develop.h"

namespace candela::master {
namespace {

constexpr double kRoundSeconds = 0.1;    // between rounds of upkeep
constexpr double kSummarySeconds = 0.5;  // between summaries of a job's chains
constexpr double kRetrySeconds = 1;      // after a checkpoint that failed
constexpr double kImageSeconds = 60;     // between images of a running job
constexpr double kIdleFilmSeconds = 60;  // before the film of a job that has ended gives its memory back
constexpr double kShortFilmSeconds = 2;  // the same where memory is short
constexpr double kEstimateGrowth = 1.1;  // of iterations between estimates
constexpr double kMinEstimateSeconds = 0.25;
constexpr double kEstimateShare = 0.05;  // of one thread, at most, by the estimates of all jobs

}  // namespace

std::size_t estimating_jobs(const std::map<std::string, Job>& jobs) {
  return static_cast<std::size_t>(std::count_if(jobs.begin(), jobs.end(), [](const auto& entry) {
    return entry.second.row.state == JobState::running;
  }));
}

void JobUpkeep::upkeep_loop() {
  while (!wake_.stopping()) {
    const bool force = flush_requested_.exchange(false);
    std::vector<std::string> ids;
    std::size_t estimating = 0;
    std::uint64_t idle_bytes = 0;  // of ended jobs
    bool short_of_memory = false;
    table_.with_films([&](Scheduler& s, const JobFilms& films) {
      short_of_memory = s.short_of_memory();
      for (const auto& [id, job] : s.jobs()) {
        // Thousands of jobs may have ended. One whose film is not in memory needs nothing.
        const auto film = films.find(id);
        if (!has_ended(job.row.state) || (film != films.end() && film->second->loaded())) ids.push_back(id);
        if (has_ended(job.row.state) && !ids.empty() && ids.back() == id) idle_bytes += job.need.held();
      }
      estimating = estimating_jobs(s.jobs());
    });
    for (const std::string& id : ids) {
      if (wake_.stopping()) break;
      const Lock lock(mutex_);
      estimating_jobs_ = static_cast<double>(std::max<std::size_t>(estimating, 1));
      idle_seconds_ =
          short_of_memory || idle_bytes > idle_limit_bytes_ ? kShortFilmSeconds : kIdleFilmSeconds;
      try {
        upkeep(id, force);
      } catch (const std::bad_alloc&) {  // an estimate or an image: the next round tries again
        room_ = {};
        log::warn("the upkeep of a job is tried again: out of memory", {.job = id});
        jobs_[id].last_estimate = JobTable::now().seconds + kRetrySeconds;
      }
    }
    {
      const Lock lock(mutex_);
      if (room_.film && JobTable::now().seconds - room_used_ > kIdleFilmSeconds) room_ = {};
    }
    wake_.sleep(kRoundSeconds);
  }
}

bool JobUpkeep::save_checkpoint(const std::string& job_id, JobFilm& film) {
  State& state = jobs_[job_id];
  state.last_checkpoint = JobTable::now().seconds;
  table_.remember_states(job_id, film);
  Result<JobFilm::Checkpoint> written =
      bulk_.run([&]() CANDELA_REQUIRES(mutex_) { return film.checkpoint(room_); });
  room_used_ = JobTable::now().seconds;
  keep_manifest(job_id);
  if (!written.ok()) {
    ++counters_.checkpoint_failures;
    state.retry_at = JobTable::now().seconds + kRetrySeconds;
    const std::string text = written.error().to_string();
    table_.with_scheduler([&](Scheduler& s) {
      // Once per cause: a disk may be full for hours.
      if (state.checkpoint_error != text) s.event(JobTable::now(), job_id, "", "checkpoint-failed", text);
      s.set_note(job_id,
                 fmt::format("the checkpoint could not be written, trying again; generation {} serves: {}",
                             film.generation(), text));
    });
    state.checkpoint_error = text;
    return false;
  }
  ++counters_.checkpoints;
  table_.with_scheduler([&](Scheduler& s) {
    if (!state.checkpoint_error.empty()) {
      s.event(JobTable::now(), job_id, "", "checkpoint", "checkpoints can be written again");
      s.set_note(job_id, "");
    }
    s.checkpointed(job_id, written->generation, written->iterations, JobTable::now());
  });
  state.checkpoint_error.clear();
  state.retry_at = 0;
  return true;
}

// A job without a manifest is as safe as its store: worth an event, and another attempt at the next
// checkpoint.
void JobUpkeep::keep_manifest(const std::string& job_id) {
  State& state = jobs_[job_id];
  const Result<void> written = truth_.keep_manifest(job_id);
  const std::string text = written.ok() ? "" : written.error().to_string();
  if (!text.empty() && text != state.manifest_error)
    table_.with_scheduler(
        [&](Scheduler& s) { s.event(JobTable::now(), job_id, "", "manifest-failed", text); });
  state.manifest_error = text;
}

std::optional<JobUpkeep::Estimate> JobUpkeep::estimate(const std::string& job_id, JobFilm& film,
                                                       ErrorHistory* history) {
  const JobFilm::Snapshot copy =
      bulk_.run([&]() CANDELA_REQUIRES(mutex_) { return film.snapshot_in(room_); });
  room_used_ = JobTable::now().seconds;
  if (!copy.film) return std::nullopt;
  if (history != nullptr) *history = ErrorHistory::of(copy.history.get());
  const JobRow row = table_.with_scheduler([&](Scheduler& s) { return s.job(job_id)->row; });
  const auto development = bulk_.run([&] { return develop(row, copy, {}); });
  if (!development.ok()) {
    log::warn(fmt::format("no error estimate: {}", development.error().to_string()), {.job = job_id});
    return std::nullopt;
  }
  stats::ErrorContext context = stats::context_of(row.settings.integrator_settings, row.plan);
  const stats::Movement movement = copy.movement.movement(*copy.film);
  context.movement = &movement;
  const stats::Movement::Bias measured = measured_bias(row, copy);
  context.measured = &measured;
  Estimate out;
  out.error =
      bulk_.run([&] { return stats::error_interval(stats::halves_of(*copy.film, *development), context); });
  out.iterations = copy.film->iterations();
  out.merged = {copy.film->merged(0), copy.film->merged(1)};
  append_convergence(table_.folder_of(job_id), {row.iterations_of(out.iterations), row.elapsed_seconds,
                                                out.error.relmse, out.error.upper});
  return out;
}

void JobUpkeep::estimate_error(const std::string& job_id, JobFilm& film, bool at_once) {
  State& state = jobs_[job_id];
  struct Figures {
    std::uint64_t iterations = 0;
    bool both = false;
  };
  const Figures f = table_.with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(job_id);
    return Figures{job->row.iterations, job->merged[0].count() > 0 && job->merged[1].count() > 0};
  });
  if (!f.both || f.iterations == state.estimated_iterations) return;
  if (!at_once) {
    const double wait =
        std::max(state.estimate_cost * estimating_jobs_ / kEstimateShare, kMinEstimateSeconds);
    if (JobTable::now().seconds - state.last_estimate < wait) return;
    if (static_cast<double>(f.iterations) < kEstimateGrowth * static_cast<double>(state.estimated_iterations))
      return;
  }
  const double started = state.last_estimate = JobTable::now().seconds;
  const std::optional<Estimate> e = estimate(job_id, film);
  if (!e) return;
  state.last_estimate = JobTable::now().seconds;
  state.estimate_cost = state.last_estimate - started;
  state.estimated_iterations = e->iterations;
  table_.with_scheduler([&](Scheduler& s) { s.relmse_estimated(job_id, e->error.relmse, e->error.upper); });
}

// The film moves on before the scheduler does: units beyond the next border are cut after that alone.
bool JobUpkeep::look_at_prefixes(const std::string& job_id, JobFilm& film) {
  State& state = jobs_[job_id];
  while (!wake_.stopping()) {
    const auto prefix = table_.with_scheduler([&](Scheduler& s) { return s.whole_prefix(job_id); });
    if (!prefix) return false;
    film.move_border(prefix->border);
    if (state.looked.version != prefix->border.version) {
      ErrorHistory history;
      const std::optional<Estimate> e = estimate(job_id, film, &history);
      if (!e) return false;
      bool is_prefix = true;  // or it was cut before the job was to end by its error
      for (std::uint32_t half = 0; half < 2; ++half) {
        if (!contains(e->merged[half], 0, prefix->border.end[half])) {  // the film was read again
          truth_.agree_if_short(job_id, film);
          return false;
        }
        is_prefix &= end_of(e->merged[half]) <= prefix->border.end[half];
      }
      bool ends = false;
      if (is_prefix) {
        history.decide({prefix->rounds, e->error.upper});
        ends = prefix->may_end && ends_at(history.prefixes, prefix->rounds, prefix->relmse);
        film.remember_history(history.serialise());
      }
      state.estimated_iterations = e->iterations;
      state.last_estimate = JobTable::now().seconds;
      state.looked = {prefix->border.version, ends};
      table_.with_scheduler(
          [&](Scheduler& s) { s.relmse_estimated(job_id, e->error.relmse, e->error.upper); });
    }
    if (!state.looked.ends) film.move_border(prefix->next);
    const bool ended = table_.with_scheduler(
        [&](Scheduler& s) { return s.prefix_decided(job_id, *prefix, state.looked.ends, JobTable::now()); });
    if (ended) {
      film.close();
      film.discard_ahead();
      table_.with_scheduler(
          [&](Scheduler& s) { s.recount(job_id, film.account().sample_counts, JobTable::now()); });
      return true;
    }
    if (state.looked.ends) return false;  // the job must not end yet
  }
  return false;
}

// The status of a job's chains follows its film within half a second.
void JobUpkeep::summarize_chains(const std::string& job_id, JobFilm& film, bool at_once) {
  State& state = jobs_[job_id];
  if (!at_once && JobTable::now().seconds - state.last_summary < kSummarySeconds) return;
  struct View {
    bool chains = false;
    chains::BootstrapSums bootstrap;
  };
  const View view = table_.with_scheduler([&](Scheduler& s) {
    const JobRow& row = s.job(job_id)->row;
    return View{row.chains.has_value(), row.bootstrap};
  });
  // The scheduler counts segments beyond the prefix, too, until it drops them.
  const JobFilm::Account account = film.account();
  const std::uint64_t segments = account.merged[0].count() + account.merged[1].count();
  if (segments == state.summarized_segments) return;
  const std::optional<chains::Summary> summary = film.chain_summary(view.bootstrap);
  state.last_summary = JobTable::now().seconds;
  state.summarized_segments = segments;
  if (!summary) return;
  // Chains without light are no failure while layers that need no chains have light.
  const bool black = view.chains && !(view.bootstrap.sum > 0) && film.all_black();
  table_.with_scheduler([&](Scheduler& s) {
    s.chains_summarised(job_id, *summary, JobTable::now());
    if (black) s.found_black(job_id, JobTable::now());
  });
}

void JobUpkeep::write_image(const std::string& job_id, JobFilm& film) {
  jobs_[job_id].last_image = JobTable::now().seconds;
  images_.write_file(job_id, film);
}

void JobUpkeep::upkeep(const std::string& job_id, bool force) {
  struct View {
    bool finishing = false, ended = false, paused = false, has_film = false, has_memory = false;
    std::uint64_t states = 0;
  };
  const View view = table_.with_scheduler([&](Scheduler& s) {
    if (!s.jobs().contains(job_id)) return View{};
    const Job* job = s.job(job_id);
    return View{job->finishing,
                has_ended(job->row.state),
                job->row.state == JobState::paused,
                job->row.named_state.has_value(),
                job->has_memory(),
                job->states.size()};
  });
  if (!view.has_film) return;
  const std::shared_ptr<JobFilm> film = table_.film_of(job_id);
  if (!film->loaded()) {
    if (view.ended || !view.has_memory) return;
    if (auto opened = truth_.open_film(job_id, false); !opened.ok()) {
      if (opened.error().kind == ErrorKind::resource)
        table_.with_scheduler(
            [&](Scheduler& s) { s.lack_memory(job_id, opened.error().to_string(), JobTable::now()); });
      return;
    }
  }
  const double t = JobTable::now().seconds;
  State& state = jobs_[job_id];

  // The last checkpoint has all decisions, also those that are made again after a loss.
  if (view.finishing && film->decisions() < view.states && film->next_decision()) return;
  if (view.finishing || view.ended) {
    film->close();
    film->release_ahead();  // of a job that a limit of time, or somebody, ended amid a prefix
    if (t < state.retry_at) return;
    // The last checkpoint may have saved the last merge before the rate-limited figures saw it: the film is
    // clean, and they are old.
    if (view.finishing || film->dirty()) {
      estimate_error(job_id, *film, true);
      summarize_chains(job_id, *film, true);
    }
    if ((film->dirty() || film->generation() == 0) && !save_checkpoint(job_id, *film)) return;
    if (view.finishing) {
      const bool extended = table_.with_scheduler([&](Scheduler& s) {
        s.finish(job_id, JobTable::now());
        return !has_ended(s.job(job_id)->row.state);
      });
      film->touch(t);
      if (extended) film->reopen();  // somebody wanted more in the meantime
      wake_.wake();
      if (options_.image_on_checkpoint) write_image(job_id, *film);
    } else if (force) {
      write_image(job_id, *film);
    }
    film->unload_if_idle(t, idle_seconds_);
    return;
  }
  film->reopen();
  if (look_at_prefixes(job_id, *film)) return;
  estimate_error(job_id, *film, false);
  summarize_chains(job_id, *film, false);
  const bool due = film->dirty() && t >= state.retry_at &&
                   (force || view.paused || t - state.last_checkpoint >= options_.checkpoint_seconds);
  if (due) save_checkpoint(job_id, *film);
  if (force || (due && options_.image_on_checkpoint && t - state.last_image >= kImageSeconds))
    write_image(job_id, *film);
}

void JobUpkeep::without(const std::string& job_id, const std::function<void()>& change) {
  const Lock lock(mutex_);
  change();
  jobs_.erase(job_id);
}

void JobUpkeep::flush_images() {
  flush_requested_ = true;
  wake_.wake();
}

void JobUpkeep::last_checkpoints() {
  const Lock lock(mutex_);
  for (const auto& entry : table_.films()) {
    const std::string& id = entry.first;
    const std::shared_ptr<JobFilm>& film = entry.second;
    film->close();
    const bool keeps_all = table_.with_scheduler([&](Scheduler& s) {
      const Job* job = s.job(id);
      return job != nullptr && (job->finishing || has_ended(job->row.state));
    });
    bool saved = false;
    try {
      if (keeps_all) film->release_ahead();  // it ended after the last round of upkeep
      saved = !film->dirty();
      saved = saved || save_checkpoint(id, *film);
    } catch (const std::bad_alloc&) {
    }
    if (!saved)
      log::error("the last checkpoint could not be written; the generation before serves at the next start",
                 {.job = id});
  }
}

}  // namespace candela::master
