// Decides the states of epochs, off the scheduler's lock: sums in, a blob and a row out. The blob is on disk
// before anybody hears of the state.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "master/jobs/job_table.h"
#include "master/jobs/wake_signal.h"
#include "master/store/blob_store.h"
#include "master/truth/job_truth.h"

namespace candela::master {

class EpochDecider {
 public:
  EpochDecider(JobTable& table, JobTruth& truth, BlobStore& blobs, WakeSignal& wake)
      : table_(table), truth_(truth), blobs_(blobs), wake_(wake) {}
  // The body of one thread. Returns when the farm stops.
  void decide_loop();

 private:
  // The hash of the state; empty if it cannot be decided now and will be due again. Errors: the place.
  Result<std::optional<std::string>> decide_state(const DueDecision& due);

  JobTable& table_;
  JobTruth& truth_;
  BlobStore& blobs_;
  WakeSignal& wake_;

  // State of the thread that runs decide_loop(). No lock: no other thread reads it.
  std::map<std::string, double> retry_at_;  // by job
  std::string reported_error_;
};

}  // namespace candela::master
