// Admits jobs to the master's memory.
//
// A job is admitted after its pilot, when what it needs fits beside the jobs that are admitted already, and
// keeps its memory until it ends. Jobs that wait are admitted in the order of priority, then of submission;
// a job does not pass another that only waits for running jobs to end.
#include <fmt/format.h>

#include <algorithm>

#include "common/stages/decision.h"
#include "common/stats/error_context.h"
#include "common/stats/movement_sums.h"
#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

constexpr double kAdmitSeconds = 1;  // between looks at jobs that wait, where nothing else changed
constexpr double kRetrySeconds = 3;  // after the system had too little

void add(MemoryNeed& sum, const MemoryNeed& need) {
  sum.film += need.film;
  sum.statistics += need.statistics;
  sum.chains += need.chains;
  sum.working = std::max(sum.working, need.working);
}

}  // namespace

MemoryNeed need_of(const JobRow& row, std::size_t record_bytes) {
  return need_of(row, work_of(row), record_bytes);
}

MemoryNeed need_of(const JobRow& row, const WorkPlan& work, std::size_t record_bytes) {
  const JobSettings& s = row.settings;
  MemoryNeed need =
      memory_need(work, s.width, s.height, std::max<std::uint64_t>(record_bytes, kGuessedRecordBytes));
  if (stats::context_of(s.integrator_settings, row.plan).alpha < 1) {
    const std::uint64_t movement = stats::MovementSums::memory_bytes(s.width, s.height);
    need.film += movement;
    need.working += movement;
  }
  if (row.stop.relmse == 0) return need;
  // Deltas beyond a prefix have a film of their own, and sums of each half. Its epochs are none of before.
  WorkPlan beyond;
  for (const film::AccumulatorSpec& spec : work.accumulators)
    if (spec.per == film::AccumulatorSpec::Per::job) beyond.accumulators.push_back(spec);
  need.film = 2 * need.film + statistics_bytes(beyond, s.width, s.height);
  return need;
}

void Scheduler::ask_for_memory(Job& job, std::size_t record_bytes) {
  if (!job.planned()) return;
  job.need = need_of(job.row, record_bytes);
  const bool unlimited = options_.memory_bytes == 0 && options_.statistics_bytes == 0;
  job.admitted = job.admitted || (unlimited && !has_ended(job.row.state));
  admission_due_ = true;
}

void Scheduler::admit_if_due(Now now) {
  if (admission_due_ || (short_of_memory_ && now.seconds - admission_tried_ >= kAdmitSeconds))
    admit_jobs(now);
}

void Scheduler::wait_for_memory(Job& job, const std::string& text, Now now) {
  if (job.memory_wait.empty()) event(now, job.row.id, "", "memory", text);
  job.memory_wait = text;
}

void Scheduler::admit_jobs(Now now) {
  admission_due_ = short_of_memory_ = false;
  admission_tried_ = now.seconds;
  MemoryNeed taken, kept;  // by all admitted jobs; by those of them that nobody renders
  std::vector<Job*> waiting;
  for (auto& [id, job] : jobs_) {
    if (job.admitted) {
      add(taken, job.need);
      if (job.row.state == JobState::paused) add(kept, job.need);
    } else if (!has_ended(job.row.state) && job.planned() && !job.finishing) {
      waiting.push_back(&job);
    }
  }
  std::sort(waiting.begin(), waiting.end(), [](const Job* a, const Job* b) {
    if (a->row.priority != b->row.priority) return a->row.priority > b->row.priority;
    if (a->row.submitted_unix_ms != b->row.submitted_unix_ms)
      return a->row.submitted_unix_ms < b->row.submitted_unix_ms;
    return a->row.id < b->row.id;
  });
  const auto fits = [&](MemoryNeed beside, const MemoryNeed& need) {
    add(beside, need);
    return (options_.memory_bytes == 0 || beside.all() <= options_.memory_bytes) &&
           (options_.statistics_bytes == 0 || beside.statistics <= options_.statistics_bytes);
  };
  const Job* before = nullptr;  // waits, and will have its turn
  for (Job* job : waiting) {
    if (before == nullptr && now.seconds >= job->retry_memory_at && fits(taken, job->need)) {
      add(taken, job->need);
      job->admitted = true;
      if (!std::exchange(job->memory_wait, {}).empty())
        event(now, job->row.id, "", "memory", "there is memory for it now");
      last_activity_ = now.seconds;
      continue;
    }
    short_of_memory_ = true;
    if (now.seconds < job->retry_memory_at) continue;  // it says why already
    const std::uint64_t limit = options_.memory_bytes;
    std::string text =
        fmt::format("waits for the master's memory: it needs {}", memory_text(job->need.all()));
    if (!fits({}, job->need)) {
      text += limit > 0 && job->need.all() > limit
                  ? fmt::format(", and there are {} in all: start the master with a larger --memory",
                                memory_text(limit))
                  : fmt::format(
                        ", {} of it for statistics, for which there are {} in all: start the master "
                        "with a larger --statistics-memory",
                        memory_text(job->need.statistics), memory_text(options_.statistics_bytes));
    } else if (!fits(taken, job->need)) {
      text += fmt::format(", other jobs have {} of {}", memory_text(taken.all()), memory_text(limit));
      if (job->need.statistics > 0)
        text += fmt::format(" (of statistics {}, others have {} of {})", memory_text(job->need.statistics),
                            memory_text(taken.statistics), memory_text(options_.statistics_bytes));
      if (before == nullptr && fits(kept, job->need)) before = job;
    } else {
      text += fmt::format(", and job {} has its turn before", before->row.id);
    }
    wait_for_memory(*job, text, now);
  }
}

void Scheduler::lack_memory(const std::string& id, const std::string& text, Now now) {
  Job* job = find(id);
  if (job == nullptr || !job->planned() || has_ended(job->row.state)) return;
  job->admitted = false;
  job->retry_memory_at = now.seconds + kRetrySeconds;
  short_of_memory_ = true;
  wait_for_memory(*job, fmt::format("waits for the master's memory, and tries again: {}", text), now);
}

}  // namespace candela::master
