// Writes of a store: each kind of change has a statement, and one call is one transaction.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "common/wire/wire.h"
#include "master/store/sqlite_store.h"

namespace candela::master {
namespace {

constexpr const char* kRoomEnding = ".room";
constexpr off_t kRoomBytes = 2 << 20;  // some thousand changes
constexpr std::int64_t kMaxEvents = 100000;

std::string join(const std::vector<std::string>& parts) {
  std::string out;
  for (const std::string& p : parts) out += (out.empty() ? "" : ",") + p;
  return out;
}

std::string lines_of(const std::vector<std::string>& parts) {
  std::string out;
  for (const std::string& p : parts) out += p + '\n';
  return out;
}

void wire_audit(const JobAudit& audit, v1::JobAudit& out) {
  out.set_pilot_sha256(audit.pilot_sha256);
  for (const std::string& worker : audit.pilot_by) out.add_pilot_by(worker);
  out.set_pilot_due(audit.pilot_due);
  for (const std::string& worker : audit.bootstrap_by) out.add_bootstrap_by(worker);
  out.set_anew(audit.anew);
  for (const Taint& taint : audit.taints) {
    v1::Taint& t = *out.add_taints();
    t.set_worker(taint.worker);
    t.set_since_unix_ms(taint.since_unix_ms);
    t.set_units(taint.units);
  }
}

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

// Half, begin and end of each range.
std::vector<std::uint64_t> ranges_of(const std::array<film::IndexSet, 2>& sets) {
  std::vector<std::uint64_t> out;
  for (std::uint64_t h = 0; h < 2; ++h)
    for (const auto& [begin, end] : sets[h].ranges()) out.insert(out.end(), {h, begin, end});
  return out;
}

}  // namespace

bool SqliteStore::apply(const PutJob& c) {
  const JobRow& j = c.row;
  v1::JobSettings settings;
  wire::to_proto(j.settings, settings);
  Statement s(db_,
              "INSERT OR REPLACE INTO jobs VALUES "
              "(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?"
              ",?,?,?,?,"
              "?,?,?,?,?,?,?)");
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
  s.bind(j.tallies.sampled_merges).bind(j.tallies.repeated_merges).bind(j.tallies.bounded_walks);
  s.bind(j.submitter);
  v1::JobAudit audit;
  wire_audit(j.audit, audit);
  s.bind_blob(audit.SerializeAsString());
  s.bind_blob(bytes_of(ranges_of(j.stop_indices))).bind(j.scene_path);
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
        "DELETE FROM chain_starts WHERE job = ?1", "DELETE FROM overdue WHERE job = ?1",
        "DELETE FROM jobs WHERE id = ?1"})
    if (!Statement(db_, sql).bind(c.id).run()) return false;
  return true;
}

bool SqliteStore::apply(const PutDistrust& c) {
  return Statement(db_, "INSERT OR REPLACE INTO distrusted VALUES (?,?,?)")
      .bind(c.row.worker)
      .bind(c.row.since_unix_ms)
      .bind(c.row.reason)
      .run();
}

bool SqliteStore::apply(const DropDistrust& c) {
  return Statement(db_, "DELETE FROM distrusted WHERE worker = ?").bind(c.worker).run();
}

bool SqliteStore::apply(const ForgetWork& c) {
  for (const char* sql : {"DELETE FROM units WHERE job = ?1", "DELETE FROM leases WHERE job = ?1",
                          "DELETE FROM states WHERE job = ?1", "DELETE FROM bootstraps WHERE job = ?1",
                          "DELETE FROM chain_starts WHERE job = ?1"})
    if (!Statement(db_, sql).bind(c.job_id).run()) return false;
  return true;
}

bool SqliteStore::apply(const PutUnit& c) {
  const UnitRow& u = c.row;
  return Statement(db_, "INSERT OR REPLACE INTO units VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?)")
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
      .bind(lines_of(u.by))
      .bind(u.sha256)
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
  if (!drops) {
    Result<void> written = write_all(changes);
    if (!written.ok() && written.error().kind == ErrorKind::resource && give_room())
      written = write_all(changes);
    if (written.ok()) keep_room();
    return written;
  }
  CANDELA_TRY(execute("PRAGMA synchronous=FULL"));
  Result<void> written = write_all(changes);
  CANDELA_TRY(execute("PRAGMA synchronous=NORMAL"));
  return written;
}

void SqliteStore::keep_room() {
  constexpr auto kPause = std::chrono::seconds(10);  // between attempts on a full disk
  const auto now = std::chrono::steady_clock::now();
  if (has_room_ || now - room_tried_ < kPause) return;
  room_tried_ = now;
  const int fd = ::open((path_ + kRoomEnding).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return;
  has_room_ = ::posix_fallocate(fd, 0, kRoomBytes) == 0;
  if (!has_room_) static_cast<void>(::ftruncate(fd, 0));
  ::close(fd);
}

bool SqliteStore::give_room() {
  room_tried_ = std::chrono::steady_clock::now();
  return std::exchange(has_room_, false) && ::truncate((path_ + kRoomEnding).c_str(), 0) == 0;
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

bool SqliteStore::apply(const DropUnit& c) {
  return Statement(db_, "DELETE FROM units WHERE id = ?").bind(c.id).run();
}

bool SqliteStore::apply(const DropUnmergedUnits& c) {
  return Statement(db_, "DELETE FROM units WHERE job = ? AND state != 2").bind(c.job_id).run() &&
         Statement(db_, "DELETE FROM leases WHERE job = ?").bind(c.job_id).run();
}

bool SqliteStore::apply(const DropMergedFrom& c) {
  for (std::uint32_t half = 0; half < 2; ++half)
    if (c.begin[half] <= Limits::max_iterations &&
        !Statement(db_, "DELETE FROM units WHERE job = ? AND state = 2 AND half = ? AND first >= ?")
             .bind(c.job_id)
             .bind(half)
             .bind(c.begin[half])
             .run())
      return false;
  return true;
}

bool SqliteStore::apply(const PutLease& c) {
  return Statement(db_, "INSERT OR REPLACE INTO leases VALUES (?,?,?,?,?,?)")
      .bind(c.row.token)
      .bind(c.row.unit_id)
      .bind(c.row.job_id)
      .bind(c.row.worker_id)
      .bind(c.row.expected_seconds)
      .bind(c.row.speculative ? 1 : 0)
      .run();
}

bool SqliteStore::apply(const DropLease& c) {
  return Statement(db_, "DELETE FROM leases WHERE token = ?").bind(c.token).run();
}

bool SqliteStore::apply(const PutWorker& c) {
  const WorkerRow& w = c.row;
  return Statement(db_, "INSERT OR REPLACE INTO workers VALUES (?,?,?,?,?,?,?,?,?,?,?,?)")
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
      .bind(w.paused ? 1 : 0)
      .run();
}

bool SqliteStore::apply(const DropWorker& c) {
  return Statement(db_, "DELETE FROM workers WHERE id = ?").bind(c.id).run();
}

bool SqliteStore::apply(const PutBundle& c) {
  return Statement(db_, "INSERT OR IGNORE INTO bundles VALUES (?,?)").bind(c.sha256).bind_blob(c.bytes).run();
}

}  // namespace candela::master
