// The store in one SQLite database, one connection, one mutex. Its parts: the schema and the connection
// (sqlite_store.cpp), what is written (sqlite_store_write.cpp), what is read (sqlite_store_read.cpp).
#pragma once

#include <sqlite3.h>

#include <chrono>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/mutex.h"
#include "master/store/columns.h"
#include "master/store/store.h"

namespace candela::master {

class SqliteStore final : public Store {
 public:
  SqliteStore(sqlite3* db, std::string path) : db_(db), path_(std::move(path)) {}
  ~SqliteStore() override { sqlite3_close_v2(db_); }

  Result<void> initialise();

  Result<std::uint64_t> next_epoch() override;
  Result<StoredState> load() override;
  Result<void> write(std::span<const Change> changes) override;
  Result<std::vector<UnitRow>> merged_units(const std::string& job_id) override;
  Result<std::map<std::string, std::uint64_t>> units_by(const std::string& worker,
                                                        const std::vector<std::string>& worker_ids,
                                                        const std::string& job_id) override;
  Result<std::vector<EventRow>> events(const std::string& job_id, std::uint32_t limit) override;
  Result<std::optional<std::string>> bundle(const std::string& sha256) override;
  Result<std::vector<OverdueRow>> overdue() override;
  Result<std::vector<MakerRow>> makers() override;

 private:
  Error failure(std::string_view what) const CANDELA_REQUIRES(mutex_);
  Result<void> execute(const char* sql) CANDELA_REQUIRES(mutex_);
  Result<void> write_all(std::span<const Change> changes) CANDELA_REQUIRES(mutex_);
  // Keeps some room on the disk for the store itself, so that what people decide on a full disk is kept.
  void keep_room() CANDELA_REQUIRES(mutex_);
  bool give_room() CANDELA_REQUIRES(mutex_);
  template <class Record>
  Result<std::vector<Record>> read_rows(const char* sql, std::string_view what) const
      CANDELA_REQUIRES(mutex_);
  Result<JobRow> read_job(Statement& s) const;
  Result<void> read_chains(const JobCells& cells, JobRow& j) const;
  Result<void> read_work(const JobCells& cells, JobRow& j) const;
  Result<void> read_audit(const JobCells& cells, JobRow& j) const;

  bool apply(const PutJob& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutUnit& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutBootstrap& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutStarts& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutState& c) CANDELA_REQUIRES(mutex_);
  bool apply(const DropUnit& c) CANDELA_REQUIRES(mutex_);
  bool apply(const DropUnmergedUnits& c) CANDELA_REQUIRES(mutex_);
  bool apply(const DropMergedFrom& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutLease& c) CANDELA_REQUIRES(mutex_);
  bool apply(const DropLease& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutWorker& c) CANDELA_REQUIRES(mutex_);
  bool apply(const DropWorker& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutOverdue& c) CANDELA_REQUIRES(mutex_);
  bool apply(const DropJob& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutDistrust& c) CANDELA_REQUIRES(mutex_);
  bool apply(const DropDistrust& c) CANDELA_REQUIRES(mutex_);
  bool apply(const ForgetWork& c) CANDELA_REQUIRES(mutex_);
  bool apply(const AddEvent& c) CANDELA_REQUIRES(mutex_);
  bool apply(const PutBundle& c) CANDELA_REQUIRES(mutex_);

  Mutex mutex_;
  bool has_room_ CANDELA_GUARDED_BY(mutex_) = false;
  std::chrono::steady_clock::time_point room_tried_ CANDELA_GUARDED_BY(mutex_){};
  sqlite3* db_ CANDELA_GUARDED_BY(mutex_);
  std::string path_;
};

}  // namespace candela::master
