#include "master/store/backup_store.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <memory>

#include "master/store/sqlite_schema.h"
#include "master/store/sqlite_statement.h"
#include "master/store/store.h"

namespace candela::master {
namespace {

constexpr int kBusyMilliseconds = 10000;
constexpr std::uint64_t kEpochsAhead = 1000;  // starts of the original after the backup

struct Close {
  void operator()(sqlite3* db) const { sqlite3_close_v2(db); }
};
using Database = std::unique_ptr<sqlite3, Close>;

Error store_error(sqlite3* db, std::string_view what, const std::filesystem::path& path) {
  const int code = sqlite3_errcode(db);
  std::string text = fmt::format("{}: {}", what, db != nullptr ? sqlite3_errmsg(db) : "out of memory");
  const bool full = code == SQLITE_FULL || code == SQLITE_IOERR || code == SQLITE_BUSY;
  if (!full) return failed_error(std::move(text)).at(path.string(), 0);
  return resource_error(std::move(text)).at(path.string(), 0).with_mend("is its disk full?");
}

// SQLite reads a store in WAL mode by files beside it, so it is opened for writing also to be read.
Result<Database> open_store(const std::filesystem::path& path, int flags) {
  sqlite3* raw = nullptr;
  const int code = sqlite3_open_v2(path.c_str(), &raw, SQLITE_OPEN_READWRITE | flags, nullptr);
  Database db(raw);
  if (code != SQLITE_OK) return store_error(raw, "cannot open the store", path);
  sqlite3_busy_timeout(raw, kBusyMilliseconds);
  return db;
}

}  // namespace

Result<void> copy_store(const std::filesystem::path& from, const std::filesystem::path& to) {
  CANDELA_ASSIGN(const Database source, open_store(from, 0));
  std::int64_t schema = 0;
  {
    Statement s(source.get(), "PRAGMA user_version");
    if (!s.step()) return store_error(source.get(), "cannot read the store", from);
    schema = s.integer();
  }
  if (schema != kSchemaVersion)
    return input_error(
               fmt::format("the store has schema version {}, this program knows {}", schema, kSchemaVersion))
        .at(from.string(), 0)
        .with_mend("use the candela-master that made it");
  CANDELA_ASSIGN(const Database copy, open_store(to, SQLITE_OPEN_CREATE));
  sqlite3_backup* backup = sqlite3_backup_init(copy.get(), "main", source.get(), "main");
  if (backup == nullptr) return store_error(copy.get(), "cannot copy the store", to);
  sqlite3_backup_step(backup, -1);
  if (sqlite3_backup_finish(backup) != SQLITE_OK) return store_error(copy.get(), "cannot copy the store", to);
  {
    Statement s(copy.get(), "PRAGMA quick_check(1)");
    if (!s.step()) return store_error(copy.get(), "cannot check the copy of the store", to);
    if (const std::string found = s.text(); found != "ok")
      return failed_error(fmt::format("the store is damaged: {}", found))
          .at(from.string(), 0)
          .with_mend("keep the backups there are; `candela repair` takes jobs into a new store");
  }
  Statement ahead(copy.get(), "UPDATE counters SET value = value + ? WHERE name = 'epoch'");
  if (!ahead.bind(kEpochsAhead).run())
    return store_error(copy.get(), "cannot write the copy of the store", to);
  return {};
}

Result<std::vector<std::string>> jobs_of_store(const std::filesystem::path& store) {
  CANDELA_ASSIGN(const Database db, open_store(store, 0));
  std::vector<std::string> out;
  Statement s(db.get(), "SELECT id FROM jobs ORDER BY id");
  while (s.step()) out.push_back(s.text());
  if (s.failed()) return store_error(db.get(), "cannot read the jobs", store);
  return out;
}

Result<void> drop_job(const std::filesystem::path& store, const std::string& job_id) {
  CANDELA_ASSIGN(const std::unique_ptr<Store> db, open_sqlite_store(store));
  return db->write(std::vector<Change>{DropJob{job_id}});
}

}  // namespace candela::master
