// Number of threads that the queue could use: an engine that starts workers scales by it.
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

struct Present {
  double threads = 0, workers = 0;
  double useful = 0;  // threads, to the jobs
  double per_worker() const { return workers > 0 ? threads / workers : 1; }
};

}  // namespace

double Scheduler::useful_threads(const Job& job, double threads_per_worker) const {
  if (!(job.thread_seconds > 0)) return std::max(threads_per_worker, 1.0);
  const auto open = static_cast<double>(job.source->open_indices(job.view()));
  const StageCost cost = job.source->cost();
  const double thread_seconds = open * job.thread_seconds / cost.indices_per_iteration;
  return std::max(std::min(std::ceil(thread_seconds / options_.unit_seconds),
                           open * (cost.serial ? 1 : threads_per_worker)),
                  1.0);
}

Wanted Scheduler::wanted(Now now) const {
  // Workers that can run a job, by the job's instruction set.
  std::map<std::string, Present> able;
  Present all;
  for (const auto& [id, job] : jobs_)
    if (job.open_for_leases()) able[job.row.settings.isa];
  for (const auto& [id, worker] : workers_) {
    if (!takes_part(worker, now)) continue;
    const double threads = std::max(worker.row.threads, 1U);
    const auto add = [&](Present& sum) {
      sum.threads += threads;
      sum.workers += 1;
    };
    add(all);
    for (auto& [isa, sum] : able)
      if (can_run(worker, isa)) add(sum);
  }
  double threads = 0, workers = 0;
  for (const auto& [id, job] : jobs_) {
    if (!job.open_for_leases()) continue;
    Present& present = able.at(job.row.settings.isa);
    const double per_worker = present.per_worker();
    // More workers like those that are here are of no use to a job that none of them can run.
    const bool unable = all.workers > 0 && present.workers == 0;
    const double useful = unable ? std::max(per_worker, 1.0) : useful_threads(job, per_worker);
    threads += useful;
    present.useful += useful;
  }
  // Sums of whole numbers, so that rounding makes no worker of its own.
  for (const auto& [isa, present] : able) workers += present.useful / present.per_worker();
  const double most = static_cast<double>(options_.max_workers);
  Wanted out;
  out.threads = static_cast<std::uint64_t>(std::ceil(std::min(threads, most * all.per_worker())));
  out.workers = static_cast<std::uint64_t>(std::ceil(std::min(workers, all.workers > 0 ? most : 1.0) - 1e-9));
  return out;
}

}  // namespace candela::master
