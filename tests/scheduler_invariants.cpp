#include "tests/scheduler_invariants.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "master/scheduler/scheduler.h"

namespace candela::master {

class SchedulerInvariants {
 public:
  explicit SchedulerInvariants(const Scheduler& scheduler) : s_(scheduler) {}

  std::vector<std::string> check() {
    for (const auto& [token, lease] : s_.leases_) check_lease(token, lease);
    for (const auto& [id, worker] : s_.workers_) check_worker(id, worker);
    for (const auto& [id, job] : s_.jobs_) check_job(id, job);
    for (const auto& [id, group] : s_.groups_) check_group(id, group);
    for (const auto& [id, withdrawn] : s_.withdrawn_) check_withdrawn(id, withdrawn.node.mapped());
    return std::move(violations_);
  }

 private:
  template <class... Values>
  void expect(bool holds, const char* name, fmt::format_string<Values...> text, Values&&... values) {
    if (!holds)
      violations_.push_back(std::string(name) + ": " + fmt::format(text, std::forward<Values>(values)...));
  }

  void check_lease(std::uint64_t token, const Lease& lease) {
    const LeaseRow& row = lease.row;
    expect(row.token == token && token < s_.next_token_, "lease-key", "lease {}", token);
    const auto job = s_.jobs_.find(row.job_id);
    const bool goes_on = job != s_.jobs_.end() && !job->second.finishing && !has_ended(job->second.row.state);
    expect(goes_on, "lease-job", "lease {} of job {}", token, row.job_id);
    if (job != s_.jobs_.end()) {
      const auto unit = job->second.units.find(row.unit_id);
      expect(unit != job->second.units.end() &&
                 std::count(unit->second.leases.begin(), unit->second.leases.end(), token) == 1,
             "lease-unit", "lease {} of unit {} of job {}", token, row.unit_id, row.job_id);
    }
    const auto worker = s_.workers_.find(row.worker_id);
    expect(worker != s_.workers_.end() && worker->second.leases.contains(token), "lease-worker",
           "lease {} of worker {}", token, row.worker_id);
    const double end = lease.expires + (lease.listed ? 0 : s_.options_.lease_seconds);
    expect(end >= s_.none_expires_before_, "lease-expiry", "lease {} runs out at {}, none before {}", token,
           end, s_.none_expires_before_);
  }

  void check_worker(const std::string& id, const WorkerState& worker) {
    expect(worker.row.id == id, "worker-key", "worker {} lies under {}", worker.row.id, id);
    expect(worker.leases.size() <= s_.options_.max_leases_per_worker, "worker-lease",
           "worker {} has {} leases", id, worker.leases.size());
    for (const std::uint64_t token : worker.leases) {
      const auto lease = s_.leases_.find(token);
      expect(lease != s_.leases_.end() && lease->second.row.worker_id == id, "worker-lease",
             "lease {} of worker {}", token, id);
    }
    expect(worker.distrusted == s_.distrusted_.contains(identity(worker.row)) &&
               !(worker.distrusted && !worker.leases.empty()),
           "distrusted", "worker {} with {} leases", id, worker.leases.size());
  }

  void check_group(const std::string& id, const GroupState& group) {
    expect(!group.jobs.empty(), "group", "group {} is empty", id);
    for (const std::string& member : group.jobs)
      expect(s_.jobs_.contains(member), "group", "group {} has the job {}, which is gone", id, member);
  }

  void check_job(const std::string& id, const Job& job) {
    expect(job.row.id == id && job.source != nullptr, "job-key", "job {} lies under {}", job.row.id, id);
    if (job.source == nullptr) return;
    const bool renews = job.row.pilot_outdated && job.source->kind() == Unit::Kind::pilot;
    expect(renews || job.source->kind() == kind_of_stage(job.row), "job-key",
           "job {} has the units of another stage", id);
    const auto group = job.row.frame ? s_.groups_.find(job.row.frame->group_id) : s_.groups_.end();
    expect(job.row.frame
               ? group != s_.groups_.end() && &group->second == job.group && group->second.jobs.contains(id)
               : job.group == nullptr,
           "group", "job {} is not where its group is", id);
    const bool ended = has_ended(job.row.state);
    expect(!(ended || job.finishing) || job.units.empty(), "job-ended", "job {} has {} units", id,
           job.units.size());
    expect(!ended || (!job.finishing && !job.row.repairs_to), "job-ended", "job {} ends again", id);
    expect(job.row.iterations == count(job.merged), "merged-count", "job {} counts {} of {} indices", id,
           job.row.iterations, count(job.merged));
    const auto audits = [&](bool rechecks) {
      return static_cast<std::uint64_t>(std::count_if(
          job.units.begin(), job.units.end(),
          [&](const auto& entry) { return entry.second.audit && entry.second.audit->recheck == rechecks; }));
    };
    expect(job.held.size() == audits(false) && job.rechecks == audits(true), "audit",
           "job {} counts {} held units of {}, {} rechecks of {}", id, job.held.size(), audits(false),
           job.rechecks, audits(true));
    expect(!(ended || job.finishing) || job.rechecks == 0, "doubtful", "job {} ends with {} rechecks", id,
           job.rechecks);
    HalfSets in_units;
    for (const auto& [unit_id, unit] : job.units) check_unit(job, unit_id, unit, in_units);
    if (!ended && !job.finishing) check_indices(job, in_units);
    check_states(job);
    std::uint64_t leases = 0, under_way = 0;
    for (const auto& [token, lease] : s_.leases_) leases += lease.row.job_id == id ? 1 : 0;
    for (const auto& [worker_id, worker] : s_.workers_) {
      if (worker.leases.empty()) continue;
      const auto oldest = s_.leases_.find(*worker.leases.begin());
      under_way += oldest != s_.leases_.end() && oldest->second.row.job_id == id ? 1 : 0;
    }
    expect(job.leases == leases && job.under_way == under_way, "job-leases",
           "job {} counts {} of {} leases, {} of {} under way", id, job.leases, leases, job.under_way,
           under_way);
  }

  static Unit::Kind kind_of_stage(const JobRow& row) {
    if (!row.named_state) return row.chains ? Unit::Kind::bootstrap : Unit::Kind::pilot;
    return row.chains ? Unit::Kind::segments : Unit::Kind::iterations;
  }

  void check_unit(const Job& job, std::uint64_t id, const UnitState& unit, HalfSets& in_units) {
    const std::string& job_id = job.row.id;
    const Unit& u = unit.row.unit;
    expect(unit.row.id == id && id < s_.next_unit_id_ && unit.row.job_id == job_id, "unit-key",
           "unit {} of job {}", id, job_id);
    expect(unit.row.state == (unit.leases.empty() ? UnitRow::State::open : UnitRow::State::leased),
           "unit-state", "unit {} of job {} with {} leases", id, job_id, unit.leases.size());
    expect(!unit.leases.empty() || job.maybe_open.contains(id), "unit-offered", "unit {} of job {}", id,
           job_id);
    expect(unit.leases.size() <= 2 && unit.speculated == (unit.leases.size() > 1), "unit-lease",
           "unit {} of job {} has {} leases", id, job_id, unit.leases.size());
    std::set<std::string> workers;
    for (const std::uint64_t token : unit.leases) {
      const auto lease = s_.leases_.find(token);
      const bool known =
          lease != s_.leases_.end() && lease->second.row.unit_id == id && lease->second.row.job_id == job_id;
      expect(known && workers.insert(lease->second.row.worker_id).second, "unit-lease",
             "lease {} of unit {} of job {}", token, id, job_id);
    }
    if (unit.audit && !check_audit(job, id, unit)) return;
    expect(u.kind == job.source->kind(), "unit-kind", "unit {} of job {}", id, job_id);
    if (u.kind == Unit::Kind::pilot) return;
    const bool sane = u.half < 2 && u.begin < u.end;
    expect(sane && in_units[u.half].insert(u.begin, u.end), "unit-once",
           "unit {} of job {}: [{}, {}) of half {}", id, job_id, u.begin, u.end, u.half);
    expect(sane && !merged(job)[u.half].intersects(u.begin, u.end), "unit-unmerged",
           "unit {} of job {}: [{}, {}) of half {}", id, job_id, u.begin, u.end, u.half);
  }

  // False: nothing is to be merged of the unit.
  bool check_audit(const Job& job, std::uint64_t id, const UnitState& unit) {
    const Audit& audit = *unit.audit;
    const Unit& u = unit.row.unit;
    expect(audit.recheck || (job.held.contains(id) && !audit.answers.empty()), "audit", "unit {} of job {}",
           id, job.row.id);
    std::set<std::string> workers;
    for (const AuditAnswer& answer : audit.answers)
      expect(workers.insert(answer.worker).second && !s_.distrusted_.contains(answer.worker), "audit",
             "the answer of {} to unit {} of job {}", answer.worker, id, job.row.id);
    if (!audit.recheck) return true;
    expect(
        audit.row ? u.half < 2 && contains(job.merged[u.half], u.begin, u.end) : u.kind == Unit::Kind::pilot,
        "audit-merged", "unit {} of job {}", id, job.row.id);
    return false;
  }

  // The indices that the present stage has brought.
  static HalfSets merged(const Job& job) {
    if (const chains::BootstrapTable* table = job.source->table()) return {table->known(), {}};
    return job.merged;
  }

  // Indices that the source will not cut again are merged, in a unit, or not asked for; nothing else may
  // be missing, or the job never ends.
  void check_indices(const Job& job, const HalfSets& in_units) {
    const std::string& id = job.row.id;
    if (job.source->kind() == Unit::Kind::pilot) {
      expect(job.source->has_unit(job.view()) == job.units.empty(), "all-indices", "the pilot of job {}", id);
      return;
    }
    const HalfSets done = merged(job), unwanted = job.source->makes_film() ? job.unwanted() : HalfSets();
    for (std::uint32_t h = 0; h < 2; ++h) {
      const film::IndexSet& reserved = job.source->reserved()[h];
      const film::IndexSet wanted_elsewhere = united(united(done[h], in_units[h]), unwanted[h]);
      const film::IndexSet lost = without(reserved, wanted_elsewhere),
                           twice = without(wanted_elsewhere, reserved);
      if (!lost.ranges().empty())
        expect(false, "all-indices", "nobody has, and nobody will get, {} of half {} of job {}", text(lost),
               h, id);
      if (!twice.ranges().empty())
        expect(false, "all-indices", "{} of half {} of job {} will be cut again", text(twice), h, id);
    }
  }

  static std::string text(const film::IndexSet& set) {
    std::string out;
    for (const auto& [begin, end] : set.ranges()) out += fmt::format("[{}, {})", begin, end);
    return out;
  }

  void check_states(const Job& job) {
    const std::string& id = job.row.id;
    expect(job.states.size() <= job.known_states.size(), "job-states", "job {} has {} states of {}", id,
           job.states.size(), job.known_states.size());
    for (std::size_t e = 0; e < std::min(job.states.size(), job.known_states.size()); ++e)
      expect(job.states[e].epoch == e && job.states[e].sha256 == job.known_states[e], "job-states",
             "job {}, state {}", id, e);
    if (!job.row.chains || !job.row.named_state || has_ended(job.row.state) || job.finishing) return;
    expect(job.starts.empty() || job.starts.size() == job.row.chains->chains, "job-starts",
           "job {} has {} starts of {} chains", id, job.starts.size(), job.row.chains->chains);
  }

  void check_withdrawn(const std::string& id, const Job& job) {
    expect(has_ended(job.row.state) && job.units.empty() && !s_.jobs_.contains(id), "withdrawn", "job {}",
           id);
  }

  const Scheduler& s_;
  std::vector<std::string> violations_;
};

std::vector<std::string> check_invariants(const Scheduler& scheduler) {
  return SchedulerInvariants(scheduler).check();
}

}  // namespace candela::master
