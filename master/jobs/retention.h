// Jobs that go after --keep-finished, and blobs that no job refers to. docs/decisions/051-removal.md
//
// A removal is atomic. The job leaves the scheduler's sight; its folder moves to DATA/removed; the store
// drops its rows; the folder is deleted. The move decides: a start finishes what lies in DATA/removed.
//
// The ends of jobs are told by the wall clock, which may jump. A job that is old by it waits for a tenth of
// the time that finished jobs are kept, at most six hours, and stays if the clock makes it young again. The
// wait is summed over all runs of the master, by steady clocks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "common/base/result.h"
#include "master/jobs/farm_counters.h"
#include "master/jobs/job_table.h"
#include "master/jobs/job_upkeep.h"
#include "master/jobs/wake_signal.h"
#include "master/options.h"
#include "master/store/blob_store.h"
#include "master/store/store.h"
#include "master/truth/job_truth.h"

namespace candela::master {

class Retention {
 public:
  // All must outlive this object.
  Retention(JobTable& table, JobTruth& truth, JobUpkeep& upkeep, BlobStore& blobs, Store& store,
            StoreWriter& writer, FarmCounters& counters, WakeSignal& wake, const MasterOptions& options)
      : table_(table),
        truth_(truth),
        upkeep_(upkeep),
        blobs_(blobs),
        store_(store),
        writer_(writer),
        counters_(counters),
        wake_(wake),
        options_(options) {}

  // Finishes the removals that a crash broke off. Precondition: nobody has loaded the store.
  static Result<void> finish_removals(Store& store, const std::filesystem::path& data_folder);

  // The body of one thread. Returns when the farm stops.
  void loop();

 private:
  void restore_waits();
  void remove_old_jobs();
  void keep_waits();
  bool remove(const std::string& job_id, std::int64_t finished_unix_ms);
  void collect_blobs();
  // Hashes of all blobs that a job may need. Nothing: that cannot be told now, and the log says why.
  std::optional<std::set<std::string>> needed_blobs();

  JobTable& table_;
  JobTruth& truth_;
  JobUpkeep& upkeep_;
  BlobStore& blobs_;
  Store& store_;
  StoreWriter& writer_;
  FarmCounters& counters_;
  WakeSignal& wake_;
  const MasterOptions& options_;

  // Jobs that are too old, by id: their end, and how long they have been seen to be.
  struct Old {
    std::int64_t finished_unix_ms = 0;
    double waited_seconds = 0;
  };
  std::map<std::string, Old> old_;
  std::optional<double> last_round_;  // by the steady clock
  bool waits_kept_ = false;           // the store has some
  std::string blobs_kept_because_;    // as the log said last
};

}  // namespace candela::master
