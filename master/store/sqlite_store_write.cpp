// Writes of a store: each kind of change has a statement, and one call is one transaction.
#include <fcntl.h>
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
constexpr std::int64_t kKeptEvents = 100000;

v1::JobAudit message_of(const JobAudit& audit) {
  v1::JobAudit out;
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
  return out;
}

}  // namespace

bool SqliteStore::apply(const PutJob& c) {
  const JobRow& j = c.row;
  v1::JobSettings settings;
  wire::to_proto(j.settings, settings);
  v1::ChainStatus status;
  if (j.chains || !chains::by_mutation(j.chain_summary).empty()) wire::to_proto(j.chain_summary, status);
  v1::WorkPlan work;
  wire::to_proto(WorkPlan{{}, j.accumulators, {}, j.epochs, j.development}, work);
  const JobCells cells{
      .settings = {settings.SerializeAsString()},
      .work = {work.SerializeAsString()},
      .chain_status = {status.SerializeAsString()},
      .audit = {message_of(j.audit).SerializeAsString()},
      .decided = {j.decided},
      .pilot_form = j.pilot_outdated ? 0 : 1,
      .state = std::string(name(j.state)),
      .repairs_to = j.repairs_to ? std::string(name(*j.repairs_to)) : "",
      .film_scale_log2 = j.named_state ? j.named_state->film_scale_log2 : std::nan(""),
      .plan = j.chains.value_or(ChainPlan()),
      .bootstrap_b = j.named_state ? j.named_state->bootstrap_b : 0,
      .frame = j.frame.value_or(FrameRow()),
  };
  return put_row(db_, "jobs", j, cells);
}

bool SqliteStore::apply(const PutBootstrap& c) {
  return put_row(db_, "bootstraps", c.row);
}

bool SqliteStore::apply(const PutStarts& c) {
  return put_row(db_, "chain_starts", c) &&
         Statement(db_, "DELETE FROM bootstraps WHERE job = ?").bind(c.job_id).run();
}

bool SqliteStore::apply(const PutState& c) {
  return put_row(db_, "states", c.row);
}

bool SqliteStore::apply(const PutOverdue& c) {
  return Statement(db_, "DELETE FROM overdue").run() &&
         std::all_of(c.rows.begin(), c.rows.end(), [&](const OverdueRow& row) CANDELA_REQUIRES(mutex_) {
           return put_row(db_, "overdue", row);
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
  return put_row(db_, "distrusted", c.row);
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
  return put_row(db_, "units", c.row);
}

bool SqliteStore::apply(const AddEvent& c) {
  if (!put_row(db_, "events", c.row)) return false;
  const std::int64_t id = sqlite3_last_insert_rowid(db_);
  if (id % 1000 != 0) return true;  // old ones go now and then, not every time
  return Statement(db_, "DELETE FROM events WHERE id <= ?").bind(id - kKeptEvents).run();
}

Result<void> SqliteStore::write(std::span<const Change> changes) {
  const Lock lock(mutex_);
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
    if (std::visit([&](const auto& c) CANDELA_REQUIRES(mutex_) { return apply(c); }, change)) continue;
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
  return put_row(db_, "leases", c.row);
}

bool SqliteStore::apply(const DropLease& c) {
  return Statement(db_, "DELETE FROM leases WHERE token = ?").bind(c.token).run();
}

bool SqliteStore::apply(const PutWorker& c) {
  return put_row(db_, "workers", c.row);
}

bool SqliteStore::apply(const DropWorker& c) {
  return Statement(db_, "DELETE FROM workers WHERE id = ?").bind(c.id).run();
}

bool SqliteStore::apply(const PutBundle& c) {
  return Statement(db_, "INSERT OR IGNORE INTO bundles VALUES (?,?)").bind(c.sha256).bind_blob(c.bytes).run();
}

}  // namespace candela::master
