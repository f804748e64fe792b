// The store behind the master: an interface, so that another database can stand behind it. SQLite (WAL) is
// the one there is. Every function may be called from any thread; errors are the caller's to report.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "master/store/records.h"

namespace candela::master {

struct StoredState {
  std::vector<JobRow> jobs;
  std::vector<UnitRow> unmerged_units;
  std::vector<LeaseRow> leases;
  std::vector<WorkerRow> workers;
  std::vector<BootstrapRow> bootstraps;                            // of those that are not complete
  std::map<std::string, std::vector<std::uint64_t>> chain_starts;  // by job
  std::map<std::string, std::vector<StateRow>> states;             // by job, in the order of epochs
  std::vector<DistrustRow> distrusted;
  std::uint64_t next_unit_id = 1;
  std::uint64_t audit_secret = 0;  // of this store, made at random with it
};

class Store {
 public:
  virtual ~Store() = default;
  // Adds one to the persisted epoch, durably (synced to the disk), and returns it. Fencing tokens start from
  // it, so it must never be handed out twice, not even after a power failure.
  virtual Result<std::uint64_t> next_epoch() = 0;
  virtual Result<StoredState> load() = 0;
  // All of them or none.
  virtual Result<void> write(std::span<const Change> changes) = 0;
  virtual Result<std::vector<UnitRow>> merged_units(const std::string& job_id) = 0;
  // The number of merged units of each job, or of one, that this worker brought: those that name the
  // identity, and those that name nobody and are of one of these ids.
  virtual Result<std::map<std::string, std::uint64_t>> units_by(const std::string& worker,
                                                                const std::vector<std::string>& worker_ids,
                                                                const std::string& job_id) = 0;
  virtual Result<std::vector<EventRow>> events(const std::string& job_id,
                                               std::uint32_t limit) = 0;  // newest last
  virtual Result<std::optional<std::string>> bundle(const std::string& sha256) = 0;
  virtual Result<std::vector<OverdueRow>> overdue() = 0;
  // Returns the pairs (deliverer, makers) of all merged units that have makers, each pair once.
  virtual Result<std::vector<MakerRow>> makers() = 0;
};

// `path` is the database file; created, with its schema, where it does not exist. A schema of a newer program
// is refused.
Result<std::unique_ptr<Store>> open_sqlite_store(const std::filesystem::path& path);

// Writes changes behind the back of their makers, in order, in batches, so that no lock of theirs is held
// across disk I/O. After an error the batch stays at the head of the queue and is tried again until it
// succeeds.
class StoreWriter {
 public:
  // `on_error` is told of each failure (from the writer's thread), and of the recovery with an empty text.
  StoreWriter(Store& store, std::function<void(const std::string&)> on_error);
  ~StoreWriter();  // tries to write what is left, for a bounded time
  StoreWriter(const StoreWriter&) = delete;
  StoreWriter& operator=(const StoreWriter&) = delete;

  // Takes them all, or none of them if memory runs out (std::bad_alloc).
  void enqueue(std::vector<Change>& changes);
  void enqueue(std::vector<Change>&& changes) { enqueue(changes); }
  // Returns when everything enqueued before is written, or with the error that keeps it from being so.
  Result<void> flush();
  std::size_t backlog() const;

 private:
  void run();

  Store& store_;
  std::function<void(const std::string&)> on_error_;
  mutable Mutex mutex_;
  std::condition_variable work_, written_;
  std::deque<Change> queue_ CANDELA_GUARDED_BY(mutex_);
  std::uint64_t enqueued_ CANDELA_GUARDED_BY(mutex_) = 0, done_ CANDELA_GUARDED_BY(mutex_) = 0,
                          failures_ CANDELA_GUARDED_BY(mutex_) = 0;
  std::optional<Error> error_ CANDELA_GUARDED_BY(mutex_);
  bool urgent_ CANDELA_GUARDED_BY(mutex_) = false, stop_ CANDELA_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace candela::master
