// The store in one SQLite database, one connection, one mutex.
//
// WAL with synchronous=NORMAL: a crash of the program loses nothing; a power failure may lose the last
// transactions but never corrupts. That is safe here because the film's checkpoint file itself holds the
// exact set of merged units, and the rows are reconciled with it at every start. The one thing that must
// survive is the epoch of the fencing tokens: it is written with synchronous=FULL.
#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

#include "common/film/layers.h"
#include "common/wire/wire.h"
#include "master/store/sqlite_schema.h"
#include "master/store/sqlite_statement.h"
#include "master/store/store.h"

namespace candela::master {
namespace {

constexpr std::int64_t kMaxEvents = 100000;

// The causes whose columns stand together; that of statistics came later.
constexpr auto kStatistics = static_cast<std::size_t>(film::RejectCause::statistics);
template <class Counts>
auto first_causes(Counts& counts) {
  return std::span(counts).template first<kStatistics>();
}

std::string join(const std::vector<std::string>& parts) {
  std::string out;
  for (const std::string& p : parts) out += (out.empty() ? "" : ",") + p;
  return out;
}

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

// Numbers as little-endian bytes, and back; bytes that are no whole numbers give none.
static_assert(std::endian::native == std::endian::little);
template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
template <class T>
std::vector<T> numbers_of(const std::string& bytes) {
  std::vector<T> values(bytes.size() % sizeof(T) == 0 ? bytes.size() / sizeof(T) : 0);
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

// Half, begin and end of each range, and back.
std::vector<std::uint64_t> ranges_of(const std::array<film::IndexSet, 2>& sets) {
  std::vector<std::uint64_t> out;
  for (std::uint64_t h = 0; h < 2; ++h)
    for (const auto& [begin, end] : sets[h].ranges()) out.insert(out.end(), {h, begin, end});
  return out;
}
std::array<film::IndexSet, 2> sets_of(const std::vector<std::uint64_t>& ranges) {
  std::array<film::IndexSet, 2> out;
  for (std::size_t i = 0; i + 2 < ranges.size(); i += 3)
    if (ranges[i] < 2) out[ranges[i]].insert(ranges[i + 1], ranges[i + 2]);
  return out;
}

std::optional<JobState> state_of(std::string_view text) {
  for (const JobState state : {JobState::queued, JobState::running, JobState::paused, JobState::done,
                               JobState::failed, JobState::cancelled})
    if (name(state) == text) return state;
  return std::nullopt;
}

class SqliteStore final : public Store {
 public:
  SqliteStore(sqlite3* db, std::string path) : db_(db), path_(std::move(path)) {}
  ~SqliteStore() override { sqlite3_close_v2(db_); }

  Result<void> initialise() {
    sqlite3_busy_timeout(db_, 5000);
    for (const char* pragma :
         {"PRAGMA journal_mode=WAL", "PRAGMA synchronous=NORMAL", "PRAGMA journal_size_limit=67108864"})
      CANDELA_TRY(execute(pragma));
    std::int64_t found = 0;
    {
      Statement s(db_, "PRAGMA user_version");
      if (!s.step()) return failure("cannot read the schema version");
      found = s.integer();
    }
    if (found == kSchemaVersion) return {};
    if (found < 0 || found > kSchemaVersion)
      return input_error(
                 fmt::format("the store has schema version {}, this program knows {}", found, kSchemaVersion))
          .at(path_, 0)
          .with_mend("use the candela-master that made it, or another --data folder");
    CANDELA_TRY(execute("BEGIN IMMEDIATE"));
    Result<void> made;
    if (found == 0) made = execute(kSchema);
    if (found == 1) made = execute(kFromVersion1);
    if (made.ok() && (found == 1 || found == 2)) made = execute(kFromVersion2);
    if (made.ok() && found < 3) made = execute(kChainTables);
    if (made.ok() && found != 0 && found < 4) made = execute(kFromVersion3);
    if (made.ok() && found != 0 && found < 5) made = execute(kFromVersion4);
    if (made.ok() && found < 5) made = execute(kStateTable);
    if (made.ok() && found != 0) made = execute(kFromVersion5);
    if (made.ok() && found > 2) made = execute(kBootstrapsFromVersion5);
    if (made.ok()) made = execute(kOverdueTable);
    if (made.ok()) made = execute(fmt::format("PRAGMA user_version={}", kSchemaVersion).c_str());
    if (made.ok()) made = execute("COMMIT");
    if (!made.ok()) sqlite3_exec(db_, "ROLLBACK", nullptr, nullptr, nullptr);
    return made;
  }

  Result<std::uint64_t> next_epoch() override {
    const std::lock_guard lock(mutex_);
    CANDELA_TRY(execute("PRAGMA synchronous=FULL"));
    Result<void> done = execute(
        "INSERT INTO counters VALUES ('epoch', 1) ON CONFLICT (name) DO UPDATE SET value = value + 1");
    CANDELA_TRY(execute("PRAGMA synchronous=NORMAL"));
    CANDELA_TRY(std::move(done));
    Statement s(db_, "SELECT value FROM counters WHERE name = 'epoch'");
    if (!s.step()) return failure("cannot read the epoch");
    return s.count();
  }

  Result<StoredState> load() override;
  Result<void> write(std::span<const Change> changes) override;
  Result<std::vector<UnitRow>> merged_units(const std::string& job_id) override;
  Result<std::vector<EventRow>> events(const std::string& job_id, std::uint32_t limit) override;
  Result<std::optional<std::string>> bundle(const std::string& sha256) override;
  Result<std::vector<OverdueRow>> overdue() override;

 private:
  Error failure(std::string_view what) const {
    const int code = sqlite3_errcode(db_);
    std::string text = fmt::format("{}: {}", what, sqlite3_errmsg(db_));
    Error e = code == SQLITE_FULL || code == SQLITE_IOERR || code == SQLITE_BUSY
                  ? resource_error(std::move(text))
                  : failed_error(std::move(text));
    e.file = path_;
    return e;
  }
  Result<void> execute(const char* sql) {
    if (sqlite3_exec(db_, sql, nullptr, nullptr, nullptr) != SQLITE_OK)
      return failure("the store refused a command");
    return {};
  }
  Result<void> write_all(std::span<const Change> changes);
  static UnitRow read_unit(Statement& s);
  Result<void> read_chains(Statement& s, JobRow& j) const;
  Result<void> read_work(Statement& s, JobRow& j) const;

  bool apply(const PutJob& c);
  bool apply(const PutUnit& c);
  bool apply(const PutBootstrap& c);
  bool apply(const PutStarts& c);
  bool apply(const PutState& c);
  bool apply(const DropUnit& c) { return Statement(db_, "DELETE FROM units WHERE id = ?").bind(c.id).run(); }
  bool apply(const DropUnmergedUnits& c) {
    return Statement(db_, "DELETE FROM units WHERE job = ? AND state != 2").bind(c.job_id).run() &&
           Statement(db_, "DELETE FROM leases WHERE job = ?").bind(c.job_id).run();
  }
  bool apply(const PutLease& c) {
    return Statement(db_, "INSERT OR REPLACE INTO leases VALUES (?,?,?,?,?,?)")
        .bind(c.row.token)
        .bind(c.row.unit_id)
        .bind(c.row.job_id)
        .bind(c.row.worker_id)
        .bind(c.row.expected_seconds)
        .bind(c.row.speculative ? 1 : 0)
        .run();
  }
  bool apply(const DropLease& c) {
    return Statement(db_, "DELETE FROM leases WHERE token = ?").bind(c.token).run();
  }
  bool apply(const PutWorker& c) {
    const WorkerRow& w = c.row;
    return Statement(db_, "INSERT OR REPLACE INTO workers VALUES (?,?,?,?,?,?,?,?,?,?,?)")
        .bind(w.id)
        .bind(w.session)
        .bind(w.name)
        .bind(w.host)
        .bind(w.build_id)
        .bind(w.threads)
        .bind(join(w.isas))
        .bind(w.draining ? 1 : 0)
        .bind(w.units_merged)
        .bind(w.units_failed)
        .bind(w.last_seen_unix_ms)
        .run();
  }
  bool apply(const DropWorker& c) {
    return Statement(db_, "DELETE FROM workers WHERE id = ?").bind(c.id).run();
  }
  bool apply(const PutOverdue& c);
  bool apply(const DropJob& c);
  bool apply(const AddEvent& c);
  bool apply(const PutBundle& c) {
    return Statement(db_, "INSERT OR IGNORE INTO bundles VALUES (?,?)")
        .bind(c.sha256)
        .bind_blob(c.bytes)
        .run();
  }

  std::mutex mutex_;
  sqlite3* db_;
  std::string path_;
};

bool SqliteStore::apply(const PutJob& c) {
  const JobRow& j = c.row;
  v1::JobSettings settings;
  wire::to_proto(j.settings, settings);
  Statement s(db_,
              "INSERT OR REPLACE INTO jobs VALUES "
              "(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?"
              ",?,?,?,?,"
              "?,?)");
  s.bind(j.id).bind(j.name).bind(j.bundle_sha256).bind_blob(settings.SerializeAsString());
  s.bind(j.stop.iterations).bind(j.stop.time_seconds).bind(j.stop.relmse);
  s.bind(j.priority).bind(j.share).bind(j.idempotency_token).bind(j.content_digest);
  s.bind(std::string(name(j.state))).bind(j.message).bind(j.stop_reason);
  if (j.named_state)
    s.bind(j.named_state->film_scale_log2);
  else
    s.bind_null();
  s.bind(j.plan).bind(j.thread_seconds_per_iteration).bind(j.submitted_unix_ms).bind(j.finished_unix_ms);
  s.bind(j.elapsed_seconds).bind(j.worker_seconds).bind(j.units_merged).bind(j.iterations);
  s.bind(j.tallies.eye_samples).bind(j.tallies.light_paths).bind(j.tallies.rays);
  for (const std::uint64_t r : first_causes(j.tallies.rejected)) s.bind(r);
  s.bind(j.relmse).bind(j.checkpoint_generation).bind(j.checkpoint_iterations);
  s.bind(join(j.layers));
  const ChainPlan plan = j.chains.value_or(ChainPlan());
  s.bind(plan.chains).bind(plan.bootstrap_samples).bind(plan.segment_mutations);
  s.bind(j.named_state ? j.named_state->bootstrap_b : 0.0).bind(j.bootstrap.sum).bind(j.bootstrap.square_sum);
  for (const std::uint64_t r : first_causes(j.bootstrap_rejected)) s.bind(r);
  v1::ChainStatus status;
  if (j.chains) wire::to_proto(j.chain_summary, status);
  s.bind_blob(status.SerializeAsString()).bind(j.pilot_scale_log2);
  s.bind_blob(bytes_of(ranges_of(j.promised))).bind(j.repairs_to ? std::string(name(*j.repairs_to)) : "");
  v1::WorkPlan work;
  wire::to_proto(WorkPlan{{}, j.accumulators, {}, j.epochs, j.development}, work);
  s.bind_blob(work.SerializeAsString());
  s.bind(j.tallies.rejected[kStatistics]).bind(j.bootstrap_rejected[kStatistics]);
  s.bind(j.tallies.sampled_merges).bind(j.tallies.repeated_merges);
  return s.run();
}

bool SqliteStore::apply(const PutBootstrap& c) {
  const BootstrapRow& row = c.row;
  Statement s(
      db_,
      "INSERT OR REPLACE INTO bootstraps (job, first, contributions, rejected_nan, rejected_infinite, "
      "rejected_negative, rejected_saturated, rejected_statistics) VALUES (?,?,?,?,?,?,?,?)");
  s.bind(row.job_id).bind(row.begin).bind_blob(bytes_of(row.contributions));
  for (const std::uint64_t r : row.rejected) s.bind(r);
  return s.run();
}

bool SqliteStore::apply(const PutStarts& c) {
  return Statement(db_, "INSERT OR REPLACE INTO chain_starts VALUES (?,?)")
             .bind(c.job_id)
             .bind_blob(bytes_of(c.starts))
             .run() &&
         Statement(db_, "DELETE FROM bootstraps WHERE job = ?").bind(c.job_id).run();
}

bool SqliteStore::apply(const PutState& c) {
  return Statement(db_, "INSERT OR REPLACE INTO states VALUES (?,?,?,?,?)")
      .bind(c.row.job_id)
      .bind(c.row.epoch)
      .bind(c.row.name)
      .bind(c.row.sha256)
      .bind(c.row.size_bytes)
      .run();
}

bool SqliteStore::apply(const PutOverdue& c) {
  if (!Statement(db_, "DELETE FROM overdue").run()) return false;
  return std::all_of(c.rows.begin(), c.rows.end(), [&](const OverdueRow& row) {
    return Statement(db_, "INSERT INTO overdue VALUES (?,?,?)")
        .bind(row.job_id)
        .bind(row.finished_unix_ms)
        .bind(row.waited_seconds)
        .run();
  });
}

bool SqliteStore::apply(const DropJob& c) {
  for (const char* sql :
       {"DELETE FROM bundles WHERE sha256 = (SELECT bundle FROM jobs WHERE id = ?1) AND NOT EXISTS "
        "(SELECT 1 FROM jobs WHERE bundle = bundles.sha256 AND id != ?1)",
        "DELETE FROM units WHERE job = ?1", "DELETE FROM leases WHERE job = ?1",
        "DELETE FROM states WHERE job = ?1", "DELETE FROM bootstraps WHERE job = ?1",
        "DELETE FROM chain_starts WHERE job = ?1", "DELETE FROM jobs WHERE id = ?1"})
    if (!Statement(db_, sql).bind(c.id).run()) return false;
  return true;
}

bool SqliteStore::apply(const PutUnit& c) {
  const UnitRow& u = c.row;
  return Statement(db_, "INSERT OR REPLACE INTO units VALUES (?,?,?,?,?,?,?,?,?,?,?)")
      .bind(u.id)
      .bind(u.job_id)
      .bind(1 + static_cast<int>(u.unit.kind))
      .bind(u.unit.half)
      .bind(u.unit.begin)
      .bind(u.unit.end)
      .bind(static_cast<int>(u.state))
      .bind(u.failures)
      .bind(u.worker_id)
      .bind(u.token)
      .bind(u.seconds)
      .run();
}

bool SqliteStore::apply(const AddEvent& c) {
  const EventRow& e = c.row;
  if (!Statement(db_, "INSERT INTO events (unix_ms, job, worker, kind, message) VALUES (?,?,?,?,?)")
           .bind(e.unix_ms)
           .bind(e.job_id)
           .bind(e.worker_id)
           .bind(e.kind)
           .bind(e.message)
           .run())
    return false;
  const std::int64_t id = sqlite3_last_insert_rowid(db_);
  if (id % 1000 != 0) return true;  // old ones go now and then, not every time
  return Statement(db_, "DELETE FROM events WHERE id <= ?").bind(id - kMaxEvents).run();
}

Result<void> SqliteStore::write(std::span<const Change> changes) {
  const std::lock_guard lock(mutex_);
  // The files of a dropped job go next: no power failure may bring its rows back.
  const bool drops = std::any_of(changes.begin(), changes.end(),
                                 [](const Change& c) { return std::holds_alternative<DropJob>(c); });
  if (!drops) return write_all(changes);
  CANDELA_TRY(execute("PRAGMA synchronous=FULL"));
  Result<void> written = write_all(changes);
  CANDELA_TRY(execute("PRAGMA synchronous=NORMAL"));
  return written;
}

Result<void> SqliteStore::write_all(std::span<const Change> changes) {
  CANDELA_TRY(execute("BEGIN IMMEDIATE"));
  for (const Change& change : changes) {
    if (std::visit([&](const auto& c) { return apply(c); }, change)) continue;
    Error e = failure("cannot write to the store");
    sqlite3_exec(db_, "ROLLBACK", nullptr, nullptr, nullptr);
    return e;
  }
  Result<void> committed = execute("COMMIT");
  if (!committed.ok()) sqlite3_exec(db_, "ROLLBACK", nullptr, nullptr, nullptr);
  return committed;
}

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
      for (std::uint64_t* count : {&j.tallies.rejected[kStatistics], &j.bootstrap_rejected[kStatistics],
                                   &j.tallies.sampled_merges, &j.tallies.repeated_merges})
        *count = s.count();
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

}  // namespace

Result<std::unique_ptr<Store>> open_sqlite_store(const std::filesystem::path& path) {
  sqlite3* db = nullptr;
  const int code = sqlite3_open_v2(
      path.c_str(), &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
  if (code != SQLITE_OK) {
    Error e = input_error(fmt::format("cannot open the store: {}", db ? sqlite3_errmsg(db) : "out of memory"))
                  .at(path.string(), 0);
    sqlite3_close_v2(db);
    return e;
  }
  auto store = std::make_unique<SqliteStore>(db, path.string());
  CANDELA_TRY(store->initialise());
  return std::unique_ptr<Store>(std::move(store));
}

}  // namespace candela::master
