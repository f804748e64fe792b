// WAL with synchronous=NORMAL: a crash of the program loses nothing; a power failure may lose the last
// transactions but never corrupts. That is safe here because the film's checkpoint file itself holds the
// exact set of merged units, and the rows are reconciled with it at every start. The one thing that must
// survive is the epoch of the fencing tokens: it is written with synchronous=FULL.
#include "master/store/sqlite_store.h"

#include <fmt/format.h>

#include "master/store/sqlite_schema.h"

namespace candela::master {

Result<void> SqliteStore::initialise() {
  const Lock lock(mutex_);
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
  if (found == kSchemaVersion) return execute(kAuditSecret);
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
  if (made.ok() && found != 0 && found < 6) made = execute(kFromVersion5);
  if (made.ok() && found > 2 && found < 6) made = execute(kBootstrapsFromVersion5);
  if (made.ok() && found < 6) made = execute(kOverdueTable);
  if (made.ok() && found != 0 && found < 7) made = execute(kFromVersion6);
  if (made.ok() && found != 0 && found < 8) made = execute(kFromVersion7);
  if (made.ok() && found != 0 && found < 9) made = execute(kFromVersion8);
  if (made.ok() && found != 0 && found < 10) made = execute(kFromVersion9);
  if (made.ok() && found < 10) made = execute(kDistrustTable);
  if (made.ok() && found != 0 && found < 11) made = execute(kFromVersion10);
  if (made.ok() && found != 0 && found < 12) made = execute(kFromVersion11);
  if (made.ok() && found != 0 && found < 13) made = execute(kFromVersion12);
  if (made.ok() && found != 0 && found < 14) made = execute(kFromVersion13);
  if (made.ok()) made = execute(kAuditSecret);
  if (made.ok()) made = execute(fmt::format("PRAGMA user_version={}", kSchemaVersion).c_str());
  if (made.ok()) made = execute("COMMIT");
  if (!made.ok()) sqlite3_exec(db_, "ROLLBACK", nullptr, nullptr, nullptr);
  return made;
}

Result<std::uint64_t> SqliteStore::next_epoch() {
  const Lock lock(mutex_);
  CANDELA_TRY(execute("PRAGMA synchronous=FULL"));
  Result<void> done =
      execute("INSERT INTO counters VALUES ('epoch', 1) ON CONFLICT (name) DO UPDATE SET value = value + 1");
  CANDELA_TRY(execute("PRAGMA synchronous=NORMAL"));
  CANDELA_TRY(std::move(done));
  Statement s(db_, "SELECT value FROM counters WHERE name = 'epoch'");
  if (!s.step()) return failure("cannot read the epoch");
  return s.count();
}

Error SqliteStore::failure(std::string_view what) const {
  const int code = sqlite3_errcode(db_);
  std::string text = fmt::format("{}: {}", what, sqlite3_errmsg(db_));
  Error e = code == SQLITE_FULL || code == SQLITE_IOERR || code == SQLITE_BUSY
                ? resource_error(std::move(text))
                : failed_error(std::move(text));
  e.file = path_;
  return e;
}

Result<void> SqliteStore::execute(const char* sql) {
  if (sqlite3_exec(db_, sql, nullptr, nullptr, nullptr) != SQLITE_OK)
    return failure("the store refused a command");
  return {};
}

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
