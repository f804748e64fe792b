// Decides the states of epochs, off the scheduler's lock and the film's: sums in, a blob, a row and a carry
// out. The blob is on disk before anybody hears of the state.
//
// The film knows how many decisions are folded into its carry, the scheduler how many states there are. They
// differ after a loss. If the film went back to an older checkpoint, its decisions are made again as its
// epochs are whole again, and must give the states that are known. If a state's blob was lost, the film's
// copy is written anew.
#pragma once

#include <map>
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
  // The next step of a job, if it can be made now. Errors: the place.
  Result<bool> step(const EpochJob& job);
  Result<bool> decide_next(const EpochJob& job, JobFilm& film);
  Result<void> restore_states(const EpochJob& job, const JobFilm& film);

  JobTable& table_;
  JobTruth& truth_;
  BlobStore& blobs_;
  WakeSignal& wake_;

  // State of the thread that runs decide_loop(). No lock: no other thread reads it.
  std::map<std::string, double> retry_at_;  // by job
  std::string reported_error_;
};

}  // namespace candela::master
