// Reads of a store: all rows at a master's start, single records later.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "common/film/layers.h"
#include "common/wire/wire.h"
#include "master/store/sqlite_store.h"

namespace candela::master {
namespace {

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> out;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    out.push_back(text.substr(at, comma - at));
    at = comma + 1;
  }
  return out;
}

// Bytes that are no whole numbers give none.
template <class T>
std::vector<T> numbers_of(const std::string& bytes) {
  std::vector<T> values(bytes.size() % sizeof(T) == 0 ? bytes.size() / sizeof(T) : 0);
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

// From half, begin and end of each range.
std::array<film::IndexSet, 2> sets_of(const std::vector<std::uint64_t>& ranges) {
  std::array<film::IndexSet, 2> out;
  for (std::size_t i = 0; i + 2 < ranges.size(); i += 3)
    if (ranges[i] < 2) out[ranges[i]].insert(ranges[i + 1], ranges[i + 2]);
  return out;
}

std::vector<std::string> lines_in(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    out.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return out;
}

std::optional<JobState> state_of(std::string_view text) {
  for (const JobState state : {JobState::queued, JobState::running, JobState::paused, JobState::done,
                               JobState::failed, JobState::cancelled})
    if (name(state) == text) return state;
  return std::nullopt;
}

}  // namespace

UnitRow SqliteStore::read_unit(Statement& s) {
  UnitRow u;
  u.id = s.count();
  u.job_id = s.text();
  u.unit.kind = static_cast<Unit::Kind>(std::clamp<std::int64_t>(s.integer(), 1, 4) - 1);
  u.unit.half = static_cast<std::uint32_t>(s.integer());
  u.unit.begin = s.count();
  u.unit.end = s.count();
  u.state = static_cast<UnitRow::State>(s.integer());
  u.failures = static_cast<std::uint32_t>(s.integer());
  u.worker_id = s.text();
  u.token = s.count();
  u.seconds = s.real();
  u.by = lines_in(s.text());
  u.sha256 = s.text();
  return u;
}

Result<void> SqliteStore::read_chains(Statement& s, JobRow& j) const {
  ChainPlan plan;
  plan.chains = static_cast<std::uint32_t>(s.integer());
  plan.bootstrap_samples = s.count();
  plan.segment_mutations = s.count();
  const double bootstrap_b = s.real();
  j.bootstrap.sum = s.real();
  j.bootstrap.square_sum = s.real();
  for (std::uint64_t& r : first_causes(j.bootstrap_rejected)) r = s.count();
  const std::string status = s.text();
  j.pilot_scale_log2 = static_cast<int>(s.integer());
  if (plan.chains == 0) return {};
  const auto unusable = [&](const std::string& why) {
    return input_error(fmt::format("the chains of job {} cannot be used: {}", j.id, why)).at(path_, 0);
  };
  if (auto valid = chains::validate(plan); !valid.ok()) return unusable(valid.error().to_string());
  if (j.layers.size() + 1 < chains::kImageLayers) return unusable("the film has too few layers");
  j.chains = plan;
  j.bootstrap.samples = plan.bootstrap_samples;
  if (j.named_state) j.named_state->bootstrap_b = bootstrap_b;
  v1::ChainStatus message;
  if (!message.ParseFromString(status)) return unusable("their figures cannot be read");
  CANDELA_ASSIGN(j.chain_summary, wire::from_proto(message));
  return {};
}

Result<void> SqliteStore::read_work(Statement& s, JobRow& j) const {
  const auto unusable = [&](const std::string& why) {
    return input_error(fmt::format("the plan of work of job {} cannot be used: {}", j.id, why)).at(path_, 0);
  };
  v1::WorkPlan message;
  if (!message.ParseFromString(s.text())) return unusable("it cannot be read");
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

Result<void> SqliteStore::read_audit(Statement& s, JobRow& j) const {
  v1::JobAudit message;
  if (!message.ParseFromString(s.text()))
    return input_error(fmt::format("what is known of the workers of job {} cannot be read", j.id))
        .at(path_, 0);
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

Result<StoredState> SqliteStore::load() {
  const std::lock_guard lock(mutex_);
  StoredState out;
  {
    Statement s(db_, "SELECT * FROM jobs ORDER BY submitted_unix_ms, id");
    while (s.step()) {
      JobRow j;
      j.id = s.text();
      j.name = s.text();
      j.bundle_sha256 = s.text();
      v1::JobSettings settings;
      if (!settings.ParseFromString(s.text()))
        return input_error(fmt::format("the settings of job {} cannot be read", j.id)).at(path_, 0);
      CANDELA_ASSIGN(j.settings, wire::from_proto(settings));
      j.stop.iterations = s.count();
      j.stop.time_seconds = s.real();
      j.stop.relmse = s.real();
      j.priority = static_cast<std::int32_t>(s.integer());
      j.share = s.real();
      j.idempotency_token = s.text();
      j.content_digest = s.text();
      const std::string state = s.text();
      if (const auto known = state_of(state))
        j.state = *known;
      else
        return input_error(fmt::format("job {} has the unknown state '{}'", j.id, state)).at(path_, 0);
      j.message = s.text();
      j.stop_reason = s.text();
      if (s.null_here())
        s.integer();
      else
        j.named_state = NamedState{static_cast<int>(s.integer())};
      j.plan = s.text();
      j.thread_seconds_per_iteration = s.real();
      j.submitted_unix_ms = s.integer();
      j.finished_unix_ms = s.integer();
      j.elapsed_seconds = s.real();
      j.worker_seconds = s.real();
      j.units_merged = s.count();
      j.iterations = s.count();
      j.tallies.eye_samples = s.count();
      j.tallies.light_paths = s.count();
      j.tallies.rays = s.count();
      for (std::uint64_t& r : first_causes(j.tallies.rejected)) r = s.count();
      j.relmse = s.real();
      j.checkpoint_generation = s.count();
      j.checkpoint_iterations = s.count();
      j.layers = split(s.text());
      if (auto layout = film::make_layout(j.settings.width, j.settings.height, j.layers); !layout.ok())
        return input_error(
                   fmt::format("the layers of job {} cannot be used: {}", j.id, layout.error().to_string()))
            .at(path_, 0);
      CANDELA_TRY(read_chains(s, j));
      j.promised = sets_of(numbers_of<std::uint64_t>(s.text()));
      j.repairs_to = state_of(s.text());
      CANDELA_TRY(read_work(s, j));
      for (std::uint64_t* count :
           {&j.tallies.rejected[kStatistics], &j.bootstrap_rejected[kStatistics], &j.tallies.sampled_merges,
            &j.tallies.repeated_merges, &j.tallies.bounded_walks})
        *count = s.count();
      j.submitter = s.text();
      CANDELA_TRY(read_audit(s, j));
      j.stop_indices = sets_of(numbers_of<std::uint64_t>(s.text()));
      j.scene_path = s.text();
      out.jobs.push_back(std::move(j));
    }
    if (s.failed()) return failure("cannot read the jobs");
  }
  {
    Statement s(db_, "SELECT * FROM units WHERE state != 2 ORDER BY id");
    while (s.step()) out.unmerged_units.push_back(read_unit(s));
    if (s.failed()) return failure("cannot read the units");
  }
  {
    Statement s(db_, "SELECT * FROM leases ORDER BY token");
    while (s.step()) {
      LeaseRow l;
      l.token = s.count();
      l.unit_id = s.count();
      l.job_id = s.text();
      l.worker_id = s.text();
      l.expected_seconds = s.real();
      l.speculative = s.integer() != 0;
      out.leases.push_back(std::move(l));
    }
    if (s.failed()) return failure("cannot read the leases");
  }
  {
    Statement s(db_, "SELECT job, epoch, name, sha256, size_bytes FROM states ORDER BY job, epoch");
    while (s.step()) {
      StateRow row;
      row.job_id = s.text();
      row.epoch = s.count();
      row.name = s.text();
      row.sha256 = s.text();
      row.size_bytes = s.count();
      out.states[row.job_id].push_back(row);
    }
    if (s.failed()) return failure("cannot read the states");
  }
  {
    Statement s(db_, "SELECT * FROM workers ORDER BY id");
    while (s.step()) {
      WorkerRow w;
      w.id = s.text();
      w.session = s.text();
      w.name = s.text();
      w.host = s.text();
      w.build_id = s.text();
      w.threads = static_cast<std::uint32_t>(s.integer());
      w.isas = split(s.text());
      w.draining = s.integer() != 0;
      w.units_merged = s.count();
      w.units_failed = s.count();
      w.last_seen_unix_ms = s.integer();
      w.paused = s.integer() != 0;
      out.workers.push_back(std::move(w));
    }
    if (s.failed()) return failure("cannot read the workers");
  }
  {
    Statement s(db_, "SELECT * FROM bootstraps ORDER BY job, first");
    while (s.step()) {
      BootstrapRow row;
      s.integer();
      row.job_id = s.text();
      row.begin = s.count();
      row.contributions = numbers_of<float>(s.text());
      for (std::uint64_t& r : row.rejected) r = s.count();
      out.bootstraps.push_back(std::move(row));
    }
    if (s.failed()) return failure("cannot read the bootstraps");
  }
  {
    Statement s(db_, "SELECT * FROM chain_starts");
    while (s.step()) {
      const std::string job = s.text();
      out.chain_starts[job] = numbers_of<std::uint64_t>(s.text());
    }
    if (s.failed()) return failure("cannot read the chains' starts");
  }
  {
    Statement s(db_, "SELECT worker, since_unix_ms, reason FROM distrusted ORDER BY worker");
    while (s.step()) {
      DistrustRow row;
      row.worker = s.text();
      row.since_unix_ms = s.integer();
      row.reason = s.text();
      out.distrusted.push_back(std::move(row));
    }
    if (s.failed()) return failure("cannot read the workers that are distrusted");
  }
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
  const std::lock_guard lock(mutex_);
  std::vector<UnitRow> out;
  Statement s(db_, "SELECT * FROM units WHERE job = ? AND state = 2 ORDER BY id");
  s.bind(job_id);
  while (s.step()) out.push_back(read_unit(s));
  if (s.failed()) return failure("cannot read the units");
  return out;
}

Result<std::map<std::string, std::uint64_t>> SqliteStore::units_by(const std::string& worker,
                                                                   const std::vector<std::string>& worker_ids,
                                                                   const std::string& job_id) {
  const std::lock_guard lock(mutex_);
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
  const std::lock_guard lock(mutex_);
  std::vector<MakerRow> out;
  Statement s(db_, "SELECT DISTINCT worker, made_by FROM units WHERE state = 2 AND made_by != ''");
  while (s.step()) {
    MakerRow row;
    row.worker_id = s.text();
    row.by = lines_in(s.text());
    out.push_back(std::move(row));
  }
  if (s.failed()) return failure("cannot read the units");
  return out;
}

Result<std::vector<EventRow>> SqliteStore::events(const std::string& job_id, std::uint32_t limit) {
  const std::lock_guard lock(mutex_);
  Statement s(
      db_,
      job_id.empty()
          ? "SELECT unix_ms, job, worker, kind, message FROM events WHERE ?1 = '' ORDER BY id DESC LIMIT ?2"
          : "SELECT unix_ms, job, worker, kind, message FROM events WHERE job = ?1 ORDER BY id DESC LIMIT "
            "?2");
  s.bind(job_id).bind(limit);
  std::vector<EventRow> out;
  while (s.step()) {
    EventRow e;
    e.unix_ms = s.integer();
    e.job_id = s.text();
    e.worker_id = s.text();
    e.kind = s.text();
    e.message = s.text();
    out.push_back(std::move(e));
  }
  if (s.failed()) return failure("cannot read the events");
  return std::vector<EventRow>(std::make_move_iterator(out.rbegin()), std::make_move_iterator(out.rend()));
}

Result<std::optional<std::string>> SqliteStore::bundle(const std::string& sha256) {
  const std::lock_guard lock(mutex_);
  Statement s(db_, "SELECT bytes FROM bundles WHERE sha256 = ?");
  s.bind(sha256);
  if (s.step()) return std::optional<std::string>(s.text());
  if (s.failed()) return failure("cannot read the bundle");
  return std::optional<std::string>();
}

Result<std::vector<OverdueRow>> SqliteStore::overdue() {
  const std::lock_guard lock(mutex_);
  std::vector<OverdueRow> out;
  Statement s(db_, "SELECT * FROM overdue ORDER BY job");
  while (s.step()) {
    OverdueRow row;
    row.job_id = s.text();
    row.finished_unix_ms = s.integer();
    row.waited_seconds = s.real();
    out.push_back(std::move(row));
  }
  if (s.failed()) return failure("cannot read the jobs that wait for their removal");
  return out;
}

}  // namespace candela::master
