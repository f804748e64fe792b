// How many threads the queue could use: what an engine that starts workers scales by.
#include <algorithm>
#include <cmath>

#include "master/scheduler/scheduler.h"

namespace candela::master {

Wanted Scheduler::wanted(Now now) const {
  double present = 0, workers = 0;
  for (const auto& [id, worker] : workers_) {
    if (worker.row.draining || !lives(worker, now)) continue;
    present += std::max(worker.row.threads, 1U);
    workers += 1;
  }
  const double per_worker = workers > 0 ? present / workers : 1;
  double threads = 0;
  for (const auto& [id, job] : jobs_) {
    if (!job.open_for_leases()) continue;
    const double open = static_cast<double>(job.source->open_indices(job.view()));
    const StageCost cost = job.source->cost();
    double useful = per_worker;
    if (job.thread_seconds > 0) {
      const double thread_seconds = open * job.thread_seconds / cost.indices_per_iteration;
      useful =
          std::min(std::ceil(thread_seconds / options_.unit_seconds), open * (cost.serial ? 1 : per_worker));
    }
    threads += std::max(useful, 1.0);
  }
  const double most = static_cast<double>(options_.max_workers);
  Wanted out;
  out.threads = static_cast<std::uint64_t>(std::ceil(std::min(threads, most * per_worker)));
  out.workers = workers > 0
                    ? static_cast<std::uint64_t>(std::ceil(static_cast<double>(out.threads) / per_worker))
                    : std::min<std::uint64_t>(out.threads, 1);
  return out;
}

}  // namespace candela::master
