// Audits: which workers render a unit a second time, and what follows from answers that differ.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

// A worker that has answered may do so again, if no other has, after so many times what a unit takes.
constexpr double kPatience = 3;

std::string what(const Unit& unit, std::uint64_t id) {
  return unit.kind == Unit::Kind::pilot ? std::string("the pilot") : fmt::format("unit {}", id);
}

}  // namespace

bool Scheduler::chosen_for_audit(const Job& job, const Unit& unit, const WorkerState& worker) const {
  if (!(options_.audit_share > 0)) return false;
  return worker.borne_out < kFirstAudits ||
         is_audited(options_.audit_secret, job.row.id, unit, options_.audit_share);
}

bool Scheduler::could_render(const Job& job, const WorkerState& worker, Now now) const {
  if (!usable(worker, now) || !can_run(worker, job)) return false;
  const auto standing = job.standings.find(worker.row.id);
  return standing == job.standings.end() || standing->second.retry_at <= now.seconds;
}

std::set<std::string> Scheduler::jury(const Job& job, Now now) const {
  std::set<std::string> out;
  for (const auto& [id, w] : workers_)
    if (could_render(job, w, now)) out.insert(identity(w.row));
  return out;
}

bool Scheduler::may_answer(const Job& job, const UnitState& unit, const WorkerState& worker, Now now) const {
  if (!unit.audit) return true;
  const Audit& audit = *unit.audit;
  if (!audit.decided.empty()) return true;
  const std::string who = identity(worker.row);
  if (const AuditAnswer* own = audit.of(who)) return audit.again && (!audit.disputed() || own->times < 2);
  // For the time of a unit it is another host's.
  if (now.seconds >= audit.since + options_.unit_seconds) return true;
  const auto heard = [&](std::string_view host) {
    return std::any_of(audit.answers.begin(), audit.answers.end(),
                       [&](const AuditAnswer& a) { return host_of(a.worker) == host; });
  };
  if (!heard(host_of(who))) return true;
  return std::none_of(workers_.begin(), workers_.end(), [&](const auto& entry) {
    return could_render(job, entry.second, now) && !heard(entry.second.row.host);
  });
}

bool Scheduler::lease_held(Job& job, WorkerState& worker, const FilmInputs* films, AcquireResult& out,
                           Now now) {
  for (const std::uint64_t id : job.held) {
    UnitState& unit = job.units.at(id);
    if (!offered(job, unit, worker, now) || !gather_input(job, unit, films, out, now)) continue;
    out.lease = grant(job, unit, worker, false, now);
    return true;
  }
  return false;
}

Reception Scheduler::receive(const Delivered& delivered, Now now) {
  Job& job = *find(delivered.job_id);
  UnitState& unit = job.units.at(delivered.unit_id);
  WorkerState& worker = workers_.at(delivered.worker_id);
  if (!unit.audit) {
    if (!chosen_for_audit(job, delivered.unit, worker)) return Reception::merge;
    std::set<std::string> others = jury(job, now);
    others.erase(identity(worker.row));
    if (others.empty()) {
      ++audit_counts_.alone;
      return Reception::merge;
    }
    if (delivered.content.empty()) return Reception::unknown;
    Audit audit;
    audit.since = now.seconds;
    audit.patience = kPatience * std::max(options_.unit_seconds, delivered.render_seconds);
    unit.audit = std::move(audit);
    job.held.insert(delivered.unit_id);
  }
  if (delivered.content.empty()) return Reception::unknown;
  return vote(job, unit, worker, delivered, now);
}

void Scheduler::note_compared(const Audit& audit) {
  if (audit.answers.size() < 2) {
    ++audit_counts_.alone;
    return;
  }
  ++audit_counts_.equal;
  for (auto& [id, w] : workers_)
    if (w.borne_out < kFirstAudits && identity(w.row) == audit.answers.front().worker) ++w.borne_out;
}

// The worker has rendered the unit, and nothing is merged.
void Scheduler::settle(Job& job, UnitState& unit, WorkerState& worker, const Delivered& delivered, Now now) {
  if (const auto lease = leases_.find(delivered.token); lease != leases_.end())
    job.served() += (delivered.render_seconds - lease->second.row.expected_seconds) / job.row.share;
  note_success(job, worker, now);
  note_cost(job, worker, delivered.unit, delivered.render_seconds);
  drop_lease(delivered.token, now, false);
  // A unit that was cut short: only what is there is compared, and another lease of it is for more.
  if (delivered.unit.end < unit.row.unit.end) {
    const std::vector<std::uint64_t> tokens = unit.leases;
    for (const std::uint64_t token : tokens) take_away(token, now, true);
    const Unit rest{delivered.unit.kind, delivered.unit.half, delivered.unit.end, unit.row.unit.end};
    unit.row.unit.end = delivered.unit.end;
    job.source->put_back(rest);
    save(unit);
  }
  last_activity_ = now.seconds;
}

Reception Scheduler::vote(Job& job, UnitState& unit, WorkerState& worker, const Delivered& delivered,
                          Now now) {
  Audit& audit = *unit.audit;
  const std::string who = identity(worker.row);
  const std::string name = what(unit.row.unit, unit.row.id);
  const auto own = std::find_if(audit.answers.begin(), audit.answers.end(),
                                [&](const AuditAnswer& a) { return a.worker == who; });
  const bool again = own != audit.answers.end();
  if (again && !own->content.empty() && own->content != delivered.content) {
    convict(who, fmt::format("{} of job {}: this worker rendered it twice, and not alike", name, job.row.id),
            now);
    return Reception::refused;
  }
  if (again) {
    ++own->times;
    own->sha256 = delivered.sha256;
    own->content = delivered.content;
  } else {
    audit.answers.push_back({who, delivered.sha256, delivered.content, 1});
  }
  if (!audit.decided.empty() && audit.decided != delivered.content) {
    convict(who, fmt::format("{} of job {}: others agree, this one differs", name, job.row.id), now);
    return Reception::refused;
  }
  const bool agreed =
      !audit.decided.empty() || (!audit.disputed() && (audit.recheck || again || audit.answers.size() > 1));
  if (agreed && !audit.recheck) return Reception::merge;
  if (audit.recheck) settle(job, unit, worker, delivered, now);
  if (agreed) {
    conclude(job, unit, now);
    return Reception::taken;
  }
  if (!audit.disputed()) {  // the first answer
    settle(job, unit, worker, delivered, now);
    return Reception::taken;
  }
  if (!std::exchange(audit.told, true)) {
    ++audit_counts_.disputes;
    std::vector<std::string> all;
    for (const AuditAnswer& a : audit.answers) all.push_back(a.worker);
    event(now, job.row.id, worker.row.id, "audit",
          audit.answers.size() > 1
              ? fmt::format("{}: {} gave different samples; others decide", name, fmt::join(all, ", "))
              : fmt::format("{}: {} gives other samples than were merged; others decide", name, who));
  }
  if (!decide(job, unit, now)) {
    if (!audit.recheck) settle(job, unit, worker, delivered, now);
    return Reception::taken;
  }
  const bool refused = distrusted_.contains(who);
  if (audit.recheck)
    conclude(job, unit, now);
  else if (!refused)
    return Reception::merge;
  return refused ? Reception::refused : Reception::taken;
}

// True if a majority has spoken. Whoever says otherwise is distrusted from now on.
bool Scheduler::decide(Job& job, UnitState& unit, Now now) {
  Audit& audit = *unit.audit;
  const std::string winner = audit.majority(jury(job, now));
  if (winner.empty()) return false;
  audit.decided = winner;
  const std::size_t agree = audit.workers_with(winner).size();
  std::vector<std::string> losers;
  for (const AuditAnswer& a : audit.answers)
    if (audit.key(a) != winner) losers.push_back(a.worker);
  const std::string name = what(unit.row.unit, unit.row.id);
  for (const std::string& loser : losers)
    convict(loser,
            fmt::format("{} of job {}: {} other{} agree{}, this one differs", name, job.row.id, agree,
                        agree == 1 ? "" : "s", agree == 1 ? "s" : ""),
            now);
  return true;
}

// Merged content is compared. Afterwards the unit is gone, and the job may stop or begin anew.
void Scheduler::conclude(Job& job, UnitState& unit, Now now) {
  Audit& audit = *unit.audit;
  const std::string name = what(unit.row.unit, unit.row.id);
  if (!audit.decided.empty() && audit.decided != audit.merged_key()) {
    want_anew(job,
              unit.row.unit.kind == Unit::Kind::pilot
                  ? std::string("its pilot was false")
                  : fmt::format("false samples of {} were merged", fmt::join(audit.row->by, ", ")),
              now);
    return;
  }
  std::vector<std::string> by = audit.workers_with(audit.merged_key());
  if (audit.row) {
    UnitRow row = *audit.row;
    row.by = std::move(by);
    changes_.emplace_back(PutUnit{std::move(row)});
  } else {
    job.row.audit.pilot_by = std::move(by);
    job.row.audit.pilot_due = false;
    save(job, now);
  }
  ++audit_counts_.rechecked;
  const bool pilot = !audit.row;
  const std::vector<std::uint64_t> tokens = unit.leases;
  for (const std::uint64_t token : tokens) take_away(token, now, true);
  job.units.erase(unit.row.id);
  --job.rechecks;
  if (job.doubtful()) return;
  job.row.audit.taints.clear();
  if (!pilot)
    event(now, job.row.id, "", "audit",
          "what workers that are distrusted now had merged was rendered again, alike");
  check_stop(job, now);
}

void Scheduler::add_recheck(Job& job, const Unit& unit, std::string merged_sha256,
                            const std::vector<std::string>& by, std::optional<UnitRow> row, Now now) {
  UnitState& added = add_unit(job, unit);
  Audit audit;
  audit.recheck = true;
  audit.since = now.seconds;
  audit.merged_sha256 = std::move(merged_sha256);
  for (const std::string& worker : by)
    if (!distrusted_.contains(worker)) audit.answers.push_back({worker, audit.merged_sha256, "", 1});
  audit.row = std::move(row);
  added.audit = std::move(audit);
  ++job.rechecks;
}

void Scheduler::add_pilot_recheck(Job& job, Now now) {
  const JobAudit& known = job.row.audit;
  if (!job.planned() || known.pilot_sha256.empty()) return;
  const bool there = std::any_of(job.units.begin(), job.units.end(), [](const auto& entry) {
    return entry.second.row.unit.kind == Unit::Kind::pilot;
  });
  if (there || (!known.pilot_due && !distrusts_any(known.pilot_by))) return;
  add_recheck(job, {Unit::Kind::pilot, 0, 0, 0}, known.pilot_sha256, known.pilot_by, std::nullopt, now);
}

void Scheduler::clear_units(Job& job) {
  job.units.clear();
  job.held.clear();
  job.rechecks = 0;
}

void Scheduler::want_anew(Job& job, const std::string& why, Now now) {
  drop_all_leases(job, now);
  clear_units(job);
  changes_.emplace_back(DropUnmergedUnits{job.row.id});
  job.finishing = false;
  job.row.audit.anew = why;
  rebuild_reserved(job);
  save(job, now);
}

void Scheduler::begin_anew(const std::string& id, Now now) {
  Job* found = find(id);
  if (found == nullptr || found->row.audit.anew.empty()) return;
  JobRow row = std::move(found->row);
  const std::string text = fmt::format("begun anew: {}; {} {} and {:.0f} s of workers' time are lost",
                                       row.audit.anew, row.iterations_of(row.iterations),
                                       row.chains ? "rounds" : "iterations", row.worker_seconds);
  const JobRow clean;
  row.named_state.reset();
  row.decided.clear();
  row.pilot_outdated = false;
  row.plan.clear();
  row.accumulators.clear();
  row.epochs.reset();
  row.development.reset();
  row.layers.clear();
  row.chains.reset();
  row.pilot_scale_log2 = clean.pilot_scale_log2;
  row.bootstrap = clean.bootstrap;
  row.bootstrap_rejected = clean.bootstrap_rejected;
  row.chain_summary = clean.chain_summary;
  row.thread_seconds_per_iteration = row.elapsed_seconds = row.worker_seconds = 0;
  row.units_merged = row.iterations = 0;
  row.builds.clear();
  row.sample_counts = clean.sample_counts;
  row.relmse = clean.relmse;
  row.checkpoint_generation = row.checkpoint_iterations = 0;
  row.promised = clean.promised;
  row.repairs_to.reset();
  row.stop_reason.clear();
  row.audit = {};
  row.message = text;
  if (row.state == JobState::running) row.state = JobState::queued;
  const double virtual_time = found->virtual_time;
  GroupState* const group = found->group;
  *found = Job();
  Job& job = *found;
  job.row = std::move(row);
  job.virtual_time = virtual_time;
  job.group = group;
  job.source = make_source(job.row);
  place_prefix(job);
  job.last_tick = job.unleased_since = now.seconds;
  job.first_token = next_token_;
  changes_.emplace_back(ForgetWork{id});
  ++audit_counts_.anew;
  event(now, id, "", "anew", text);
  admission_due_ = true;
  save(job, now);
  last_activity_ = now.seconds;
}

void Scheduler::tick_audits(Now now) {
  for (auto& [id, job] : jobs_) {
    if ((job.held.empty() && job.rechecks == 0) || !job.open_for_leases()) continue;
    const std::set<std::string> able = jury(job, now);
    std::vector<std::uint64_t> ids;
    for (const auto& [unit_id, unit] : job.units)
      if (unit.audit) ids.push_back(unit_id);
    for (const std::uint64_t unit_id : ids) {
      const auto unit = job.units.find(unit_id);
      if (unit == job.units.end() || !unit->second.audit) continue;
      tick_audit(job, unit->second, able, now);
    }
  }
}

void Scheduler::tick_audit(Job& job, UnitState& unit, const std::set<std::string>& able, Now now) {
  Audit& audit = *unit.audit;
  if (!audit.decided.empty()) return;
  const bool others =
      std::any_of(able.begin(), able.end(), [&](const std::string& who) { return audit.of(who) == nullptr; });
  if (audit.disputed()) {
    audit.again = !others;
    if (decide(job, unit, now) && audit.recheck) conclude(job, unit, now);
    return;
  }
  if (!audit.recheck) {
    audit.again = !others || now.seconds > audit.since + audit.patience;
    return;
  }
  // No other worker can render it: the answers so far decide.
  if (!others && !audit.answers.empty() && unit.leases.empty()) conclude(job, unit, now);
}

std::string Scheduler::dispute_text(const Job& job) const {
  if (job.held.empty() && job.rechecks == 0) return {};
  for (const auto& [id, unit] : job.units) {
    if (!unit.audit || !unit.audit->decided.empty() || !unit.audit->disputed()) continue;
    std::vector<std::string> names;
    for (const AuditAnswer& a : unit.audit->answers) names.push_back(a.worker);
    return fmt::format(
        "{}: {} gave different samples, and a further worker decides: start one, or tell which "
        "to believe with `candela workers distrust`",
        what(unit.row.unit, id), fmt::join(names, ", "));
  }
  return {};
}

}  // namespace candela::master
