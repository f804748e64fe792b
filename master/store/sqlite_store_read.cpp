// Reads of a store: all rows at a master's start, single records later.
#include <fmt/format.h>

#include <cmath>

#include "common/film/layers.h"
#include "common/wire/wire.h"
#include "master/store/sqlite_store.h"

namespace candela::master {
namespace {

std::optional<JobState> state_of(std::string_view text) {
  for (const JobState state : {JobState::queued, JobState::running, JobState::paused, JobState::done,
                               JobState::failed, JobState::cancelled})
    if (name(state) == text) return state;
  return std::nullopt;
}

}  // namespace

Result<void> SqliteStore::read_chains(const JobCells& cells, JobRow& j) const {
  const auto unusable = [&](const std::string& why) {
    return input_error(fmt::format("the chains of job {} cannot be used: {}", j.id, why)).at(path_, 0);
  };
  v1::ChainStatus message;
  if (!message.ParseFromString(cells.chain_status.text)) return unusable("their figures cannot be read");
  if (cells.plan.chains == 0) {  // mutations within iterations, or none
    if (message.groups_size() == 0) return {};
    CANDELA_ASSIGN(j.chain_summary, wire::from_proto(message));
    return {};
  }
  if (auto valid = chains::validate(cells.plan); !valid.ok()) return unusable(valid.error().to_string());
  if (j.layers.size() + 1 < chains::kImageLayers) return unusable("the film has too few layers");
  j.chains = cells.plan;
  j.bootstrap.samples = cells.plan.bootstrap_samples;
  if (j.named_state) j.named_state->bootstrap_b = cells.bootstrap_b;
  CANDELA_ASSIGN(j.chain_summary, wire::from_proto(message));
  return {};
}

Result<void> SqliteStore::read_work(const JobCells& cells, JobRow& j) const {
  const auto unusable = [&](const std::string& why) {
    return input_error(fmt::format("the plan of work of job {} cannot be used: {}", j.id, why)).at(path_, 0);
  };
  v1::WorkPlan message;
  if (!message.ParseFromString(cells.work.text)) return unusable("it cannot be read");
  auto work = wire::from_proto(message);
  if (!work.ok()) return unusable(work.error().to_string());
  work->layers = j.layers;
  if (auto valid = validate(*work, j.settings.width, j.settings.height); !valid.ok())
    return unusable(valid.error().to_string());
  j.accumulators = std::move(work->accumulators);
  j.epochs = std::move(work->epochs);
  j.development = std::move(work->development);
  return {};
}

Result<void> SqliteStore::read_audit(const JobCells& cells, JobRow& j) const {
  v1::JobAudit message;
  if (!message.ParseFromString(cells.audit.text))
    return input_error(fmt::format("the record of the workers of job {} cannot be read", j.id)).at(path_, 0);
  JobAudit& audit = j.audit;
  audit.pilot_sha256 = message.pilot_sha256();
  audit.pilot_by = {message.pilot_by().begin(), message.pilot_by().end()};
  audit.pilot_due = message.pilot_due();
  audit.bootstrap_by = {message.bootstrap_by().begin(), message.bootstrap_by().end()};
  audit.anew = message.anew();
  for (const v1::Taint& taint : message.taints())
    audit.taints.push_back({taint.worker(), taint.since_unix_ms(), taint.units()});
  return {};
}

Result<JobRow> SqliteStore::read_job(Statement& s) const {
  JobRow j;
  JobCells cells;
  Reader row(s);
  columns(row, j, cells);
  if (s.failed()) return j;  // which is told once, for all jobs
  v1::JobSettings settings;
  if (!settings.ParseFromString(cells.settings.text))
    return input_error(fmt::format("the settings of job {} cannot be read", j.id)).at(path_, 0);
  CANDELA_ASSIGN(j.settings, wire::from_proto(settings));
  const auto state = state_of(cells.state);
  if (!state)
    return input_error(fmt::format("job {} has the unknown state '{}'", j.id, cells.state)).at(path_, 0);
  j.state = *state;
  if (!std::isnan(cells.film_scale_log2)) j.named_state = NamedState{static_cast<int>(cells.film_scale_log2)};
  j.decided = std::move(cells.decided.text);
  if (j.decided.size() > Limits::max_decided_bytes)
    return input_error(fmt::format("what the pilot of job {} decided has {} bytes", j.id, j.decided.size()))
        .at(path_, 0);
  // Pilots of chains decided nothing then.
  j.pilot_outdated = j.named_state && cells.plan.chains == 0 && cells.pilot_form == 0;
  if (auto layout = film::make_layout(j.settings.width, j.settings.height, j.layers); !layout.ok())
    return input_error(
               fmt::format("the layers of job {} cannot be used: {}", j.id, layout.error().to_string()))
        .at(path_, 0);
  CANDELA_TRY(read_chains(cells, j));
  j.repairs_to = state_of(cells.repairs_to);
  if (!cells.frame.group_id.empty()) j.frame = cells.frame;
  CANDELA_TRY(read_work(cells, j));
  CANDELA_TRY(read_audit(cells, j));
  return j;
}

template <class Record>
Result<std::vector<Record>> SqliteStore::read_rows(const char* sql, std::string_view what) const {
  std::vector<Record> out;
  Statement s(db_, sql);
  Reader row(s);
  while (s.step()) columns(row, out.emplace_back());
  if (s.failed()) return failure(fmt::format("cannot read the {}", what));
  return out;
}

Result<StoredState> SqliteStore::load() {
  const Lock lock(mutex_);
  StoredState out;
  {
    Statement s(db_, "SELECT * FROM jobs ORDER BY submitted_unix_ms, id");
    while (s.step()) {
      CANDELA_ASSIGN(JobRow j, read_job(s));
      out.jobs.push_back(std::move(j));
    }
    if (s.failed()) return failure("cannot read the jobs");
  }
  CANDELA_ASSIGN(out.unmerged_units,
                 read_rows<UnitRow>("SELECT * FROM units WHERE state != 2 ORDER BY id", "units"));
  CANDELA_ASSIGN(out.leases, read_rows<LeaseRow>("SELECT * FROM leases ORDER BY token", "leases"));
  CANDELA_ASSIGN(const std::vector<StateRow> states,
                 read_rows<StateRow>("SELECT * FROM states ORDER BY job, epoch", "states"));
  for (const StateRow& row : states) out.states[row.job_id].push_back(row);
  CANDELA_ASSIGN(out.workers, read_rows<WorkerRow>("SELECT * FROM workers ORDER BY id", "workers"));
  CANDELA_ASSIGN(out.bootstraps,
                 read_rows<BootstrapRow>("SELECT * FROM bootstraps ORDER BY job, first", "bootstraps"));
  CANDELA_ASSIGN(out.distrusted, read_rows<DistrustRow>("SELECT * FROM distrusted ORDER BY worker",
                                                        "workers that are distrusted"));
  CANDELA_ASSIGN(std::vector<PutStarts> starts,
                 read_rows<PutStarts>("SELECT * FROM chain_starts", "chains' starts"));
  for (PutStarts& row : starts) out.chain_starts[row.job_id] = std::move(row.starts);
  {
    Statement s(db_, "SELECT value FROM counters WHERE name = 'audit-secret'");
    if (!s.step()) return failure("cannot read the secret of audits");
    out.audit_secret = static_cast<std::uint64_t>(s.integer());
  }
  Statement s(db_, "SELECT coalesce(max(id), 0) + 1 FROM units");
  if (!s.step()) return failure("cannot read the units");
  out.next_unit_id = s.count();
  return out;
}

Result<std::vector<UnitRow>> SqliteStore::merged_units(const std::string& job_id) {
  const Lock lock(mutex_);
  std::vector<UnitRow> out;
  Statement s(db_, "SELECT * FROM units WHERE job = ? AND state = 2 ORDER BY id");
  s.bind(job_id);
  Reader row(s);
  while (s.step()) columns(row, out.emplace_back());
  if (s.failed()) return failure("cannot read the units");
  return out;
}

Result<std::map<std::string, std::uint64_t>> SqliteStore::units_by(const std::string& worker,
                                                                   const std::vector<std::string>& worker_ids,
                                                                   const std::string& job_id) {
  const Lock lock(mutex_);
  std::string ids = "\n";
  for (const std::string& id : worker_ids) ids += id + "\n";
  std::map<std::string, std::uint64_t> out;
  std::string sql =
      "SELECT job, count(*) FROM units WHERE state = 2 AND "
      "(instr(char(10) || made_by, char(10) || ?1 || char(10)) > 0 OR "
      "(made_by = '' AND worker != '' AND instr(?2, char(10) || worker || char(10)) > 0))";
  sql += job_id.empty() ? " GROUP BY job" : " AND job = ?3 GROUP BY job";
  Statement s(db_, sql.c_str());
  s.bind(worker).bind(ids);
  if (!job_id.empty()) s.bind(job_id);
  while (s.step()) {
    const std::string job = s.text();
    out[job] = s.count();
  }
  if (s.failed()) return failure("cannot read the units");
  return out;
}

Result<std::vector<MakerRow>> SqliteStore::makers() {
  const Lock lock(mutex_);
  return read_rows<MakerRow>("SELECT DISTINCT worker, made_by FROM units WHERE state = 2 AND made_by != ''",
                             "units");
}

Result<std::vector<EventRow>> SqliteStore::events(const std::string& job_id, std::uint32_t limit) {
  const Lock lock(mutex_);
  Statement s(db_, job_id.empty() ? "SELECT * FROM events WHERE ?1 = '' ORDER BY id DESC LIMIT ?2"
                                  : "SELECT * FROM events WHERE job = ?1 ORDER BY id DESC LIMIT ?2");
  s.bind(job_id).bind(limit);
  std::vector<EventRow> out;
  Reader row(s);
  while (s.step()) columns(row, out.emplace_back());
  if (s.failed()) return failure("cannot read the events");
  return std::vector<EventRow>(std::make_move_iterator(out.rbegin()), std::make_move_iterator(out.rend()));
}

Result<std::optional<std::string>> SqliteStore::bundle(const std::string& sha256) {
  const Lock lock(mutex_);
  Statement s(db_, "SELECT bytes FROM bundles WHERE sha256 = ?");
  s.bind(sha256);
  if (s.step()) return std::optional<std::string>(s.text());
  if (s.failed()) return failure("cannot read the bundle");
  return std::optional<std::string>();
}

Result<std::vector<OverdueRow>> SqliteStore::overdue() {
  const Lock lock(mutex_);
  return read_rows<OverdueRow>("SELECT * FROM overdue ORDER BY job", "jobs that wait for their removal");
}

}  // namespace candela::master
