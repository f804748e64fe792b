#include "master/jobs/epoch_decider.h"

#include <fmt/format.h>

#include <utility>

#include "common/base/log.h"
#include "common/base/memory_limit.h"

namespace candela::master {
namespace {

constexpr double kDecideSeconds = 0.05;      // between looks for decisions that are due
constexpr double kRetryDecisionSeconds = 1;  // after one that could not be made

Result<void> put_blob(BlobStore& blobs, const std::string& sha256, std::string_view bytes) {
  CANDELA_ASSIGN(const bool there, blobs.check(sha256));
  if (there) return {};
  CANDELA_ASSIGN(const auto upload, blobs.begin(sha256, bytes.size()));
  CANDELA_TRY(upload->append(bytes));
  return upload->finish();
}

}  // namespace

Result<void> EpochDecider::restore_states(const EpochJob& job, const JobFilm& film) {
  for (const DecidedState& state : film.states()) {
    if (state.epoch < job.states || state.epoch >= film.decisions()) continue;
    // States whose bytes are gone are never leased again.
    if (const auto bytes = film.state_bytes(state.epoch)) CANDELA_TRY(put_blob(blobs_, state.sha256, *bytes));
    table_.with_scheduler([&](Scheduler& s) {
      s.decided({job.job_id, state.epoch, state.name, state.sha256, state.size_bytes}, JobTable::now());
    });
  }
  return {};
}

Result<bool> EpochDecider::decide_next(const EpochJob& job, JobFilm& film) {
  const std::optional<NextDecision> next = film.next_decision();
  if (!next) {  // a checkpoint was lost, and its units are made again
    if (job.due) truth_.agree_if_short(job.job_id, film);
    return false;
  }
  const auto fail = [&](const Error& error) {
    table_.with_scheduler([&](Scheduler& s) {
      s.fail_job(job.job_id,
                 fmt::format("the state of epoch {} cannot be decided: {}", next->epoch, error.to_string()),
                 JobTable::now());
    });
    return false;
  };
  Result<MadeDecision> made = make(*next, *film.epoch_plan(), film.layout());
  if (!made.ok()) return fail(made.error());
  const StateRow row{job.job_id, made->state.epoch, made->state.name, made->state.sha256,
                     made->state.size_bytes};
  CANDELA_TRY(put_blob(blobs_, row.sha256, made->bytes));
  if (!table_.with_scheduler([&](Scheduler& s) { return s.agrees(row, JobTable::now()); })) return false;
  const Result<bool> folded = film.fold(std::move(*made));
  if (!folded.ok()) return fail(folded.error());
  if (*folded) table_.with_scheduler([&](Scheduler& s) { s.decided(row, JobTable::now()); });
  return *folded;
}

Result<bool> EpochDecider::step(const EpochJob& job) {
  std::shared_ptr<JobFilm> film = table_.film_of(job.job_id);
  if (!film) return false;
  if (!film->loaded()) {
    CANDELA_ASSIGN(film, truth_.open_film(job.job_id));
  }
  const std::uint64_t made = film->decisions();
  if (made == job.states && !job.due) return false;
  if (made <= job.states) return decide_next(job, *film);
  CANDELA_TRY(restore_states(job, *film));
  return true;
}

void EpochDecider::decide_loop() {
  while (!wake_.stopping()) {
    bool any = false;
    for (const EpochJob& job : table_.with_scheduler([](Scheduler& s) { return s.epoch_jobs(); })) {
      if (wake_.stopping() || retry_at_[job.job_id] > JobTable::now().seconds) continue;
      const auto done = within_memory("no state can be decided", [&] { return step(job); });
      if (done.ok() && *done) {
        any = true;
        continue;
      }
      retry_at_[job.job_id] = JobTable::now().seconds + (done.ok() ? kDecideSeconds : kRetryDecisionSeconds);
      if (done.ok()) continue;
      const std::string text = done.error().to_string();
      if (std::exchange(reported_error_, text) == text) continue;
      table_.with_scheduler([&](Scheduler& s) {
        s.event(JobTable::now(), job.job_id, "", "undecided",
                fmt::format("the state of the epoch after {}: {}", job.states, text));
      });
    }
    if (!any) wake_.sleep(kDecideSeconds);
  }
}

}  // namespace candela::master
