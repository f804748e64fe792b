// Jobs against their films: after a restart, when a checkpoint turns out to be damaged, and to render again
// what is lost.
//
// The film is the truth of what is merged. A running job renders again whatever its rows tell of and its film
// lacks. An ended job does so only when it is asked (repair, extend); until then it says what is lost.
#include <fmt/format.h>

#include <algorithm>

#include "master/scheduler/scheduler.h"

namespace candela::master {

void Scheduler::rebuild_reserved(Job& job) {
  job.source->restart(united(job.merged, job.unwanted()));
  const JobView view = job.view();
  for (const auto& [id, u] : job.units)
    if (!u.audit || !u.audit->recheck) job.source->take(view, u.row.unit);
}

std::uint64_t Scheduler::agree(Job& job, const HalfSets& film, std::vector<UnitRow> rows, Now now) {
  const bool ended = has_ended(job.row.state);
  job.merged = film;
  if (job.row.pilot_outdated) job.source = make_film_source(job.row);
  HalfSets ledger, told;
  UnitSource& source = *job.source;
  source.restart(film);
  const JobView view = job.view();
  std::uint64_t merged_rows = 0, missing_rows = 0;
  const auto reopen_row = [&](UnitRow& u) {
    u.state = UnitRow::State::open;
    u.worker_id.clear();
    u.token = 0;
    UnitState state;
    state.row = u;
    job.units.emplace(u.id, std::move(state));
    job.maybe_open.insert(u.id);
  };
  for (UnitRow& u : rows) {
    const Unit& unit = u.unit;
    const bool sane =
        source.makes_film() && unit.kind == source.kind() && unit.half < 2 && unit.begin < unit.end;
    if (sane && u.state == UnitRow::State::merged) told[unit.half].insert(unit.begin, unit.end);
    if (sane && contains(film[unit.half], unit.begin, unit.end) &&
        ledger[unit.half].insert(unit.begin, unit.end)) {
      ++merged_rows;
      if (u.state == UnitRow::State::merged) continue;
      u.state = UnitRow::State::merged;  // the film had it, the row had not heard
      changes_.emplace_back(PutUnit{u});
      continue;
    }
    if (u.state == UnitRow::State::merged) ++missing_rows;
    // Segments whose chains lost the one before wait until that is there again, and are cut anew.
    if (ended || !source.take(view, unit)) {
      changes_.emplace_back(DropUnit{u.id});
      continue;
    }
    reopen_row(u);
    save(job.units.at(u.id));
  }
  for (std::uint32_t h = 0; h < 2; ++h) {
    const film::IndexSet unknown = without(film[h], ledger[h]);  // the film has it, no row tells of it
    for (const auto& [begin, end] : unknown.ranges()) {
      UnitRow u;
      u.id = next_unit_id_++;
      u.job_id = job.row.id;
      u.unit = Unit{source.kind(), h, begin, end};
      u.state = UnitRow::State::merged;
      changes_.emplace_back(PutUnit{u});
      ++merged_rows;
    }
  }
  job.row.units_merged = merged_rows;
  job.row.iterations = count(film);
  // A job that goes on renders what it lacks in any case; one that has ended must remember what that is.
  if (ended && !covers(film, told)) job.row.promised = united(job.row.promised, united(told, film));
  if (covers(film, job.row.promised)) job.row.promised = {};
  rebuild_reserved(job);
  if (!ended && missing_rows > 0)
    event(now, job.row.id, "", "reconciled",
          fmt::format("{} merged unit(s) were not in the checkpoint and run again", missing_rows));
  return missing_rows;
}

void Scheduler::restore(JobRow row, const HalfSets& film, const film::SampleCounts& sample_counts,
                        std::vector<UnitRow> unmerged, std::vector<UnitRow> merged, Now now,
                        const RestoredStages& restored) {
  const std::string id = row.id;
  Job& job = jobs_[id];
  job.row = std::move(row);
  job.source = make_source(job.row);
  join_group(job);
  wait_for(job);
  job.merged = film;
  job.last_tick = job.unleased_since = now.seconds;
  job.last_saved = now.seconds;
  job.thread_seconds = job.row.thread_seconds_per_iteration;
  ask_for_memory(job, restored.record_bytes);
  restore_chains(job, restored, now);
  restore_states(job, restored.states);
  merged.insert(merged.end(), std::make_move_iterator(unmerged.begin()),
                std::make_move_iterator(unmerged.end()));  // merged ones first
  const std::uint64_t missing = agree(job, film, std::move(merged), now);
  job.row.sample_counts = sample_counts;
  place_prefix(job);
  look_for_doubts(job, now);
  if (!has_ended(job.row.state)) {
    check_stop(job, now);
    if (!job.finishing)
      if (auto starts = check_starts(job); !starts.ok()) fail_job(id, starts.error().to_string(), now);
  } else if (missing > 0) {
    note_lost(job, "", now);
  }
  renew_pilot(job);
  save(job, now);
}

void Scheduler::adopt(JobRow row, const HalfSets& film, const film::SampleCounts& sample_counts,
                      const RestoredStages& chains, Now now) {
  const std::string id = row.id;
  event(now, id, "", "adopted", fmt::format("taken in from its folder with {} merged indices", count(film)));
  if (row.chains) changes_.emplace_back(PutStarts{id, chains.starts});
  for (const StateRow& state : chains.states) changes_.emplace_back(PutState{state});
  restore(std::move(row), film, sample_counts, {}, {}, now, chains);
  start_fairly(*find(id));
  last_activity_ = now.seconds;
}

void Scheduler::reconcile(const std::string& id, const HalfSets& film,
                          const film::SampleCounts& sample_counts, std::vector<UnitRow> merged,
                          std::uint64_t generation, const std::string& trouble, Now now) {
  Job* job = find(id);
  if (job == nullptr) return;
  drop_all_leases(*job, now);
  clear_units(*job);
  changes_.emplace_back(DropUnmergedUnits{id});
  const std::uint64_t missing = agree(*job, film, std::move(merged), now);
  if (!has_ended(job->row.state) && missing > 0)
    job->finishing = false;  // what its rows told is not all there
  job->row.sample_counts = sample_counts;
  place_prefix(*job);
  job->row.checkpoint_generation = generation;
  job->row.checkpoint_iterations = count(film);
  look_for_doubts(*job, now);
  if (has_ended(job->row.state) && missing > 0) note_lost(*job, trouble, now);
  if (!has_ended(job->row.state)) check_stop(*job, now);
  renew_pilot(*job);
  save(*job, now);
}

void Scheduler::renew_pilot(Job& job) {
  if (!job.row.pilot_outdated || has_ended(job.row.state) || job.finishing) return;
  clear_units(job);
  changes_.emplace_back(DropUnmergedUnits{job.row.id});
  job.row.audit.pilot_sha256.clear();  // it says nothing of what was decided
  job.row.audit.pilot_due = false;
  job.source = make_pilot_source();
}

std::string Scheduler::lost_text(const Job& job) {
  const std::uint64_t lost = count(job.lost());
  return fmt::format("{} of {} {} are lost: no checkpoint that can be read has them", lost,
                     lost + job.row.iterations, job.source->noun());
}

void Scheduler::note_lost(Job& job, const std::string& trouble, Now now) {
  event(now, job.row.id, "", "lost",
        lost_text(job) + (trouble.empty() ? "" : fmt::format(" ({})", trouble)) +
            fmt::format("; `candela repair {}` renders them again", job.row.id));
}

// The starts follow from the bootstrap, which is gone when the film begins: a store that lost them cannot
// make them again.
Result<void> Scheduler::check_starts(const Job& job) const {
  if (!job.row.chains || !job.row.named_state) return {};
  if (job.starts.size() == (job.row.named_state->bootstrap_b > 0 ? job.row.chains->chains : 0)) return {};
  return refused_error("the store has lost where the chains start").with_mend("submit the job again");
}

void Scheduler::reopen(Job& job, Now now) {
  job.finishing = false;
  job.row.state = JobState::queued;
  job.row.finished_unix_ms = 0;
  ask_for_memory(job, job.record_bytes);
  rebuild_reserved(job);
  place_prefix(job);
  wait_for(job);
  start_fairly(job);
  look_for_doubts(job, now);
  renew_pilot(job);
}

Result<bool> Scheduler::repair(const std::string& id, Now now) {
  Job& job = *find(id);
  if (job.row.repairs_to) return true;
  if (!has_ended(job.row.state) && !job.finishing)
    return count(job.lost()) > 0 ? Result<bool>(true)
                                 : refused_error(fmt::format("job {} is {}: what it lacks it renders anyway",
                                                             id, name(job.row.state)))
                                       .with_field("job_id");
  if (count(job.lost()) == 0) return false;
  CANDELA_TRY(check_starts(job));
  job.row.repairs_to = job.finishing ? JobState::done : job.row.state;
  event(now, id, "", "repairing", lost_text(job));
  reopen(job, now);
  last_activity_ = now.seconds;
  save(job, now);
  return true;
}

}  // namespace candela::master
