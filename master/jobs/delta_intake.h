// Deltas, from a worker's bytes to the merged sample counts: verify, decode, merge, tell the scheduler.
//
// Called by any number of threads at a time. The class has no state and no lock of its own: the gate bounds
// how many deltas are merged at a time, the film takes each delta once, and the table counts it.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "common/film/delta.h"
#include "common/job/job.h"
#include "master/jobs/delta_verdict.h"
#include "master/jobs/farm_counters.h"
#include "master/jobs/job_table.h"
#include "master/jobs/wake_signal.h"
#include "master/merge/bulk_threads.h"
#include "master/merge/push_gate.h"
#include "master/truth/job_truth.h"

namespace candela::master {

// Header of a delta, which a worker sends first.
struct DeltaHeader {
  std::string worker_id, job_id;
  std::uint64_t token = 0, unit_id = 0;
  Unit unit;
  std::string build_id;
  std::string sha256;  // of the whole encoded delta, 64 lower-case hex digits
  std::uint64_t size_bytes = 0;
  double render_seconds = 0;  // wall, 0 or more
};

struct DeltaRefusal;  // defined in delta_intake.cpp

class DeltaIntake {
 public:
  struct Verdict {
    DeltaVerdict verdict = DeltaVerdict::merged;
    std::string message;
  };

  DeltaIntake(JobTable& table, JobTruth& truth, PushGate& gate, BulkThreads& bulk, FarmCounters& counters,
              WakeSignal& wake)
      : table_(table), truth_(truth), gate_(gate), bulk_(bulk), counters_(counters), wake_(wake) {}

  // Before reading: a verdict if the delta need not be read at all.
  std::optional<Verdict> admit(const DeltaHeader& header);
  // Order of a job's deltas in the queue: they yield while a unit of a higher priority is leased.
  PushGate::Order order_of(const std::string& job_id) const;
  // Way in which a delta was received.
  struct Receipt {
    double seconds = 0, cpu_seconds = 0;
  };
  // The whole delta is here: verify, decode, merge, remember.
  Verdict deliver(const DeltaHeader& header, const std::string& bytes, const Receipt& receipt);

 private:
  // When a delta had come, how long it was on its way and how long its hash took, and when its turn came. CPU
  // time: of receiving, hash, decoding and merging.
  struct Course {
    std::chrono::steady_clock::time_point here, turn;
    double receive_seconds = 0, hash_seconds = 0, cpu_seconds = 0;
  };
  // A delta whose lease holds at this moment, and what is to become of it.
  struct Admission;
  Admission receive(const DeltaHeader& header, const film::Delta& delta, Course& course);
  // Adds a film, with accumulators and records, to the job's.
  std::optional<DeltaRefusal> merge_film(const DeltaHeader& header, const film::Delta& delta,
                                         const Admission& admission, std::vector<chains::ChainRecord> records,
                                         Course& course);
  // Adds the contributions of bootstrap samples to the job's table.
  std::optional<DeltaRefusal> merge_table(const DeltaHeader& header, const film::Delta& delta);

  JobTable& table_;
  JobTruth& truth_;
  PushGate& gate_;
  BulkThreads& bulk_;
  FarmCounters& counters_;
  WakeSignal& wake_;
};

}  // namespace candela::master
