// The store in one SQLite database, one connection, one mutex. Its parts: the schema and the connection
// (sqlite_store.cpp), what is written (sqlite_store_write.cpp), what is read (sqlite_store_read.cpp).
#pragma once

#include <sqlite3.h>

#include <bit>
#include <chrono>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "master/store/sqlite_statement.h"
#include "master/store/store.h"

namespace candela::master {

// The causes whose columns stand together; that of statistics came later.
constexpr auto kStatistics = static_cast<std::size_t>(film::RejectCause::statistics);
template <class Counts>
auto first_causes(Counts& counts) {
  return std::span(counts).template first<kStatistics>();
}

// Numbers are stored as little-endian bytes.
static_assert(std::endian::native == std::endian::little);

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
  Error failure(std::string_view what) const;
  Result<void> execute(const char* sql);
  Result<void> write_all(std::span<const Change> changes);
  // Keeps some room on the disk for the store itself, so that what people decide on a full disk is kept.
  void keep_room();
  bool give_room();
  static UnitRow read_unit(Statement& s);
  Result<void> read_chains(Statement& s, JobRow& j) const;
  Result<void> read_work(Statement& s, JobRow& j) const;
  Result<void> read_audit(Statement& s, JobRow& j) const;

  bool apply(const PutJob& c);
  bool apply(const PutUnit& c);
  bool apply(const PutBootstrap& c);
  bool apply(const PutStarts& c);
  bool apply(const PutState& c);
  bool apply(const DropUnit& c);
  bool apply(const DropUnmergedUnits& c);
  bool apply(const DropMergedFrom& c);
  bool apply(const PutLease& c);
  bool apply(const DropLease& c);
  bool apply(const PutWorker& c);
  bool apply(const DropWorker& c);
  bool apply(const PutOverdue& c);
  bool apply(const DropJob& c);
  bool apply(const PutDistrust& c);
  bool apply(const DropDistrust& c);
  bool apply(const ForgetWork& c);
  bool apply(const AddEvent& c);
  bool apply(const PutBundle& c);

  std::mutex mutex_;
  bool has_room_ = false;
  std::chrono::steady_clock::time_point room_tried_{};
  sqlite3* db_;
  std::string path_;
};

}  // namespace candela::master
