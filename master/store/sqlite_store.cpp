// The store in one SQLite database, one connection, one mutex.
//
// WAL with synchronous=NORMAL: a crash of the program loses nothing; a power failure may lose the last
// transactions but never corrupts. That is safe here because the film's checkpoint file itself holds the
// exact set of merged units, and the rows are reconciled with it at every start. The one thing that must
// survive is the epoch of the fencing tokens: it is written with synchronous=FULL.
#include <fmt/format.h>
#include <sqlite3.h>

#include <cmath>

#include "common/film/layers.h"
#include "common/wire/wire.h"
#include "master/store/store.h"

namespace candela::master {
namespace {

// 1: the first. 2: jobs.layers.
constexpr int kSchemaVersion = 2;
constexpr std::int64_t kMaxEvents = 100000;

constexpr const char* kSchema = R"sql(
CREATE TABLE counters (name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE jobs (
  id TEXT PRIMARY KEY, name TEXT NOT NULL, bundle TEXT NOT NULL, settings BLOB NOT NULL,
  stop_iterations INTEGER NOT NULL, stop_time_seconds REAL NOT NULL, stop_relmse REAL NOT NULL,
  priority INTEGER NOT NULL, share REAL NOT NULL, token TEXT NOT NULL, digest TEXT NOT NULL,
  state TEXT NOT NULL, message TEXT NOT NULL, stop_reason TEXT NOT NULL,
  film_scale_log2 INTEGER, plan TEXT NOT NULL, thread_seconds_per_iteration REAL NOT NULL,
  submitted_unix_ms INTEGER NOT NULL, finished_unix_ms INTEGER NOT NULL,
  elapsed_seconds REAL NOT NULL, worker_seconds REAL NOT NULL,
  units_merged INTEGER NOT NULL, iterations INTEGER NOT NULL,
  eye_samples INTEGER NOT NULL, light_paths INTEGER NOT NULL, rays INTEGER NOT NULL,
  rejected_nan INTEGER NOT NULL, rejected_infinite INTEGER NOT NULL, rejected_negative INTEGER NOT NULL,
  rejected_saturated INTEGER NOT NULL, relmse REAL,
  checkpoint_generation INTEGER NOT NULL, checkpoint_iterations INTEGER NOT NULL,
  layers TEXT NOT NULL DEFAULT '') WITHOUT ROWID;
CREATE TABLE units (
  id INTEGER PRIMARY KEY, job TEXT NOT NULL, kind INTEGER NOT NULL, half INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL, state INTEGER NOT NULL, failures INTEGER NOT NULL,
  worker TEXT NOT NULL, token INTEGER NOT NULL, seconds REAL NOT NULL);
CREATE INDEX units_by_job ON units (job, state);
CREATE TABLE leases (
  token INTEGER PRIMARY KEY, unit INTEGER NOT NULL, job TEXT NOT NULL, worker TEXT NOT NULL,
  expected_seconds REAL NOT NULL, speculative INTEGER NOT NULL);
CREATE TABLE workers (
  id TEXT PRIMARY KEY, session TEXT NOT NULL, name TEXT NOT NULL, host TEXT NOT NULL, build_id TEXT NOT NULL,
  threads INTEGER NOT NULL, isas TEXT NOT NULL, draining INTEGER NOT NULL, units_merged INTEGER NOT NULL,
  units_failed INTEGER NOT NULL, last_seen_unix_ms INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT, unix_ms INTEGER NOT NULL, job TEXT NOT NULL, worker TEXT NOT NULL,
  kind TEXT NOT NULL, message TEXT NOT NULL);
CREATE INDEX events_by_job ON events (job, id);
CREATE TABLE bundles (sha256 TEXT PRIMARY KEY, bytes BLOB NOT NULL) WITHOUT ROWID;
)sql";

// From version 1: its jobs have no layers. New columns go last, where kSchema has them, too.
constexpr const char* kFromVersion1 = "ALTER TABLE jobs ADD COLUMN layers TEXT NOT NULL DEFAULT ''";

// A prepared statement: binds in order, reads columns in order.
class Statement {
 public:
  explicit Statement(sqlite3* db, const char* sql) {
    if (sqlite3_prepare_v2(db, sql, -1, &stmt_, nullptr) != SQLITE_OK) stmt_ = nullptr;
  }
  ~Statement() { sqlite3_finalize(stmt_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& bind(std::int64_t v) { return check(sqlite3_bind_int64(stmt_, ++at_, v)); }
  Statement& bind(std::uint64_t v) { return bind(static_cast<std::int64_t>(v)); }
  Statement& bind(std::uint32_t v) { return bind(static_cast<std::int64_t>(v)); }
  Statement& bind(int v) { return bind(static_cast<std::int64_t>(v)); }
  Statement& bind(double v) {  // SQLite has no NaN; it stores NULL
    return check(std::isnan(v) ? sqlite3_bind_null(stmt_, ++at_) : sqlite3_bind_double(stmt_, ++at_, v));
  }
  Statement& bind(const std::string& v) {
    return check(sqlite3_bind_text64(stmt_, ++at_, v.data(), v.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  Statement& bind_blob(const std::string& v) {
    return check(sqlite3_bind_blob64(stmt_, ++at_, v.data(), v.size(), SQLITE_TRANSIENT));
  }
  Statement& bind_null() { return check(sqlite3_bind_null(stmt_, ++at_)); }

  // True while there is a row; false at the end or on an error (see failed()).
  bool step() {
    if (stmt_ == nullptr || failed_) return false;
    column_ = 0;
    const int code = sqlite3_step(stmt_);
    if (code == SQLITE_ROW) return true;
    if (code != SQLITE_DONE) failed_ = true;
    return false;
  }
  bool run() {  // for statements without rows
    step();
    return !failed();
  }
  bool failed() const { return failed_ || stmt_ == nullptr; }
  // The same statement once more.
  void reset() {
    sqlite3_reset(stmt_);
    at_ = 0;
  }

  std::int64_t integer() { return sqlite3_column_int64(stmt_, column_++); }
  std::uint64_t count() { return static_cast<std::uint64_t>(integer()); }
  double real() {
    const int c = column_++;
    return sqlite3_column_type(stmt_, c) == SQLITE_NULL ? std::numeric_limits<double>::quiet_NaN()
                                                        : sqlite3_column_double(stmt_, c);
  }
  bool null_here() const { return sqlite3_column_type(stmt_, column_) == SQLITE_NULL; }
  std::string text() {
    const int c = column_++;
    const void* data = sqlite3_column_blob(stmt_, c);
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(stmt_, c));
    return data == nullptr ? std::string() : std::string(static_cast<const char*>(data), size);
  }

 private:
  Statement& check(int code) {
    if (code != SQLITE_OK) failed_ = true;
    return *this;
  }
  sqlite3_stmt* stmt_ = nullptr;
  int at_ = 0;
  int column_ = 0;
  bool failed_ = false;
};

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
    if (found != 0 && found != 1)
      return input_error(
                 fmt::format("the store has schema version {}, this program knows {}", found, kSchemaVersion))
          .at(path_, 0)
          .with_mend("use the candela-master that made it, or another --data folder");
    CANDELA_TRY(execute("BEGIN IMMEDIATE"));
    Result<void> made = execute(found == 0 ? kSchema : kFromVersion1);
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
  static UnitRow read_unit(Statement& s);

  bool apply(const PutJob& c);
  bool apply(const PutUnit& c);
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
              "(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)");
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
  for (const std::uint64_t r : j.tallies.rejected) s.bind(r);
  s.bind(j.relmse).bind(j.checkpoint_generation).bind(j.checkpoint_iterations);
  s.bind(join(j.layers));
  return s.run();
}

bool SqliteStore::apply(const PutUnit& c) {
  const UnitRow& u = c.row;
  return Statement(db_, "INSERT OR REPLACE INTO units VALUES (?,?,?,?,?,?,?,?,?,?,?)")
      .bind(u.id)
      .bind(u.job_id)
      .bind(u.unit.kind == Unit::Kind::pilot ? 1 : 2)
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
  u.unit.kind = s.integer() == 1 ? Unit::Kind::pilot : Unit::Kind::iterations;
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
      bool known = false;
      for (const JobState candidate : {JobState::queued, JobState::running, JobState::paused, JobState::done,
                                       JobState::failed, JobState::cancelled}) {
        if (name(candidate) != state) continue;
        j.state = candidate;
        known = true;
      }
      if (!known)
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
      for (std::uint64_t& r : j.tallies.rejected) r = s.count();
      j.relmse = s.real();
      j.checkpoint_generation = s.count();
      j.checkpoint_iterations = s.count();
      j.layers = split(s.text());
      if (auto layout = film::make_layout(j.settings.width, j.settings.height, j.layers); !layout.ok())
        return input_error(
                   fmt::format("the layers of job {} cannot be used: {}", j.id, layout.error().to_string()))
            .at(path_, 0);
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
