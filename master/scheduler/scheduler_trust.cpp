// Trust: which workers are distrusted, and what becomes of the merged units that they brought.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

// Returns the identity that `word` is, or is the name of; empty: there is none. Error: the name is one of
// workers on several hosts.
Result<std::string> named_so(const std::string& word, const std::set<std::string>& identities) {
  if (identities.contains(word)) return word;
  std::vector<std::string> named;
  for (const std::string& who : identities)
    if (who.ends_with("/" + word)) named.push_back(who);
  if (named.size() > 1)
    return input_error(fmt::format("several are named so: {}", fmt::join(named, ", ")))
        .with_field("worker_id")
        .with_mend("give one of these");
  return named.empty() ? std::string() : named.front();
}

}  // namespace

bool Scheduler::distrusts_any(const std::vector<std::string>& identities) const {
  return std::any_of(identities.begin(), identities.end(),
                     [&](const std::string& who) { return distrusted_.contains(who); });
}

void Scheduler::convict(const std::string& who, const std::string& reason, Now now) {
  if (distrusted_.contains(who)) return;
  const DistrustRow row{who, now.unix_ms, reason};
  distrusted_[who] = row;
  changes_.emplace_back(PutDistrust{row});
  std::string id;
  for (auto& [worker_id, w] : workers_) {
    if (identity(w.row) != who) continue;
    id = worker_id;
    w.distrusted = true;
    const std::set<std::uint64_t> tokens = w.leases;
    for (const std::uint64_t token : tokens) take_away(token, now, true);
  }
  active_.clear();
  event(now, "", id, "distrusted",
        fmt::format("{}: {}; it gets no units (`candela workers trust` takes that back)", who, reason));
  forget_answers(who);
  for (auto& [job_id, job] : jobs_)
    if (!has_ended(job.row.state)) doubt_again(job);
  to_taint_.insert(who);
  last_activity_ = now.seconds;
}

void Scheduler::forget_answers(const std::string& who) {
  for (auto& [job_id, job] : jobs_)
    for (auto& [unit_id, unit] : job.units) {
      if (!unit.audit) continue;
      std::erase_if(unit.audit->answers, [&](const AuditAnswer& a) { return a.worker == who; });
      if (!unit.audit->answers.empty()) continue;
      unit.audit->decided.clear();
      if (unit.audit->recheck) continue;
      unit.audit.reset();
      job.held.erase(unit_id);
    }
}

void Scheduler::doubt_again(Job& job) {
  job.doubts_due = true;
  ++job.doubts;
}

void Scheduler::look_for_doubts(Job& job, Now now) {
  if (has_ended(job.row.state)) return;
  if (!distrusted_.empty()) doubt_again(job);
  if (!job.finishing) add_pilot_recheck(job, now);
}

void Scheduler::restore_distrust(const DistrustRow& row) {
  distrusted_[row.worker] = row;
  to_taint_.insert(row.worker);
}

std::set<std::string> Scheduler::known_workers(const std::vector<MakerRow>& makers) const {
  std::set<std::string> out;
  const auto add = [&out](const std::vector<std::string>& names) { out.insert(names.begin(), names.end()); };
  for (const auto& [who, row] : distrusted_) out.insert(who);
  for (const auto& [id, w] : workers_) out.insert(identity(w.row));
  for (const MakerRow& maker : makers) add(maker.by);
  for (const auto& [id, job] : jobs_) {
    add(job.row.audit.pilot_by);
    add(job.row.audit.bootstrap_by);
    for (const auto& [unit_id, unit] : job.units)
      if (unit.audit)
        for (const AuditAnswer& answer : unit.audit->answers) out.insert(answer.worker);
  }
  return out;
}

Result<DistrustRow> Scheduler::distrust(const std::string& word, Now now,
                                        const std::vector<MakerRow>& makers) {
  std::string who;
  if (const auto present = workers_.find(word); present != workers_.end()) {
    who = identity(present->second.row);
  } else if (const auto left = std::find_if(makers.begin(), makers.end(),
                                            [&](const MakerRow& maker) { return maker.worker_id == word; });
             left != makers.end() && !left->by.empty()) {
    who = left->by.front();
  } else {
    CANDELA_ASSIGN(who, named_so(word, known_workers(makers)));
    if (who.empty())
      return input_error(fmt::format("there is no worker {}, nor was there one", word))
          .with_field("worker_id");
  }
  convict(who, "an operator says so", now);
  return distrusted_.at(who);
}

Result<DistrustRow> Scheduler::trust(const std::string& word, Now now) {
  std::string who = word;
  if (const auto it = workers_.find(word); it != workers_.end()) who = identity(it->second.row);
  std::set<std::string> all;
  for (const auto& [worker, row] : distrusted_) all.insert(worker);
  CANDELA_ASSIGN(who, named_so(who, all));
  if (who.empty())
    return input_error(fmt::format("nobody is distrusted by the name of {}", word)).with_field("worker_id");
  const DistrustRow row = distrusted_.at(who);
  distrusted_.erase(who);
  to_taint_.erase(who);
  changes_.emplace_back(DropDistrust{who});
  std::string id;
  for (auto& [worker_id, w] : workers_) {
    if (identity(w.row) != who) continue;
    id = worker_id;
    w.distrusted = false;
    w.borne_out = 0;  // as if it were new
  }
  active_.clear();
  event(now, "", id, "trusted", fmt::format("{} gets units again", who));
  for (auto& [job_id, job] : jobs_)
    if (std::erase_if(job.row.audit.taints, [&](const Taint& taint) { return taint.worker == who; }) > 0)
      save(job, now);
  last_activity_ = now.seconds;
  return row;
}

AuditWork Scheduler::audit_work() {
  AuditWork out;
  for (const auto& [id, job] : jobs_) {
    if (!job.row.audit.anew.empty())
      out.anew.push_back(id);
    else if (job.doubts_due)
      out.doubts.push_back({id, job.doubts});
  }
  const std::set<std::string> all = std::exchange(to_taint_, {}), jobs = std::exchange(jobs_to_taint_, {});
  for (const auto& [who, row] : distrusted_) {
    if (!all.contains(who) && jobs.empty()) continue;
    AuditWork::Tainting tainting{who, {}, all.contains(who) ? std::set<std::string>() : jobs};
    for (const auto& [id, w] : workers_)
      if (identity(w.row) == who) tainting.worker_ids.push_back(id);
    out.taints.push_back(std::move(tainting));
  }
  return out;
}

void Scheduler::doubt(const std::string& id, std::uint64_t doubts, const std::vector<UnitRow>& rows,
                      Now now) {
  Job* job = find(id);
  if (job == nullptr || !job->doubts_due || job->doubts != doubts) return;
  job->doubts_due = false;
  if (has_ended(job->row.state)) return;
  if (distrusts_any(job->row.audit.bootstrap_by))
    return want_anew(*job, "a worker that is distrusted now made a part of its bootstrap", now);
  std::vector<const UnitRow*> doubtful;
  std::set<std::uint64_t> under_way;
  for (const auto& [unit_id, unit] : job->units)
    if (unit.audit && unit.audit->row) under_way.insert(unit.audit->row->id);
  for (const UnitRow& row : rows) {
    if (row.unit.half > 1 || !job->merged[row.unit.half].intersects(row.unit.begin, row.unit.end) ||
        under_way.contains(row.id))
      continue;
    // A row without names is of an older master, or of a ledger that was lost.
    const auto worker = workers_.find(row.worker_id);
    const bool known = !row.by.empty() || (worker != workers_.end() && !worker->second.distrusted);
    if (known && !distrusts_any(row.by)) continue;
    if (row.sha256.empty() || job->row.chains || job->row.epochs)
      return want_anew(
          *job,
          row.by.empty()
              ? std::string("nobody knows who made some of its samples, and a worker is distrusted")
              : fmt::format("a worker that is distrusted now had samples in it ({})",
                            fmt::join(row.by, ", ")),
          now);
    doubtful.push_back(&row);
  }
  const std::uint64_t before = job->rechecks;
  if (job->finishing && (!doubtful.empty() || distrusts_any(job->row.audit.pilot_by))) {
    job->finishing = false;  // it goes on until they are looked at
    if (!job->row.repairs_to) job->row.stop_reason.clear();
    rebuild_reserved(*job);
  }
  for (const UnitRow* row : doubtful) add_recheck(*job, row->unit, row->sha256, row->by, *row, now);
  if (!job->finishing) add_pilot_recheck(*job, now);
  if (!job->doubtful()) job->row.audit.taints.clear();
  if (job->rechecks > before)
    event(now, id, "", "audit",
          fmt::format("{} unit(s) of workers that are distrusted now are rendered again", job->rechecks));
  last_activity_ = now.seconds;
  if (!job->finishing) check_stop(*job, now);
}

void Scheduler::taint(const std::string& who, const std::map<std::string, std::uint64_t>& units,
                      const std::set<std::string>& only, Now now) {
  const auto distrusted = distrusted_.find(who);
  if (distrusted == distrusted_.end()) return;
  for (auto& [id, job] : jobs_) {
    if (!has_ended(job.row.state) || (!only.empty() && !only.contains(id))) continue;
    JobAudit& audit = job.row.audit;
    const auto found = units.find(id);
    const auto made = [&](const std::vector<std::string>& by) {
      return std::find(by.begin(), by.end(), who) != by.end();
    };
    const bool began = made(audit.pilot_by) || made(audit.bootstrap_by);
    if (found == units.end() && !began) continue;
    const Taint taint{who, distrusted->second.since_unix_ms, found == units.end() ? 0 : found->second};
    if (std::find(audit.taints.begin(), audit.taints.end(), taint) != audit.taints.end()) continue;
    std::erase_if(audit.taints, [&](const Taint& t) { return t.worker == who; });
    audit.taints.push_back(taint);
    event(now, id, "", "tainted", taint_text(taint));
    save(job, now);
  }
}

std::string taint_text(const Taint& taint) {
  const std::string part =
      taint.units > 0 ? fmt::format("{} unit(s)", taint.units) : "its pilot or bootstrap";
  return fmt::format("worker {}, which is distrusted, delivered {} of this job: render it again",
                     taint.worker, part);
}

}  // namespace candela::master
