// The upkeep of jobs: checkpoints, manifests, error estimates, chain summaries, images in the job's folder,
// and the last step of a job. Law 6: a job is done when its final checkpoint is on disk, not before.
//
// `mutex_` guards what is remembered of each job and admits one thread at a time to the upkeep of a job. It
// is held across I/O, so only upkeep may wait for it; the table's lock is taken under it, never the other way
// round.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "common/base/mutex.h"
#include "common/stats/error_interval.h"
#include "master/jobs/error_history.h"
#include "master/jobs/farm_counters.h"
#include "master/jobs/image_writer.h"
#include "master/jobs/job_table.h"
#include "master/jobs/wake_signal.h"
#include "master/merge/bulk_threads.h"
#include "master/options.h"
#include "master/truth/job_truth.h"

namespace candela::master {

// The jobs whose error is estimated, which share the time for it: those that run. Thousands may be queued.
std::size_t estimating_jobs(const std::map<std::string, Job>& jobs);

class JobUpkeep {
 public:
  // `options` must outlive this object. `idle_limit_bytes`: of films of ended jobs; beyond it they leave
  // memory sooner.
  JobUpkeep(JobTable& table, JobTruth& truth, ImageWriter& images, BulkThreads& bulk, FarmCounters& counters,
            WakeSignal& wake, const MasterOptions& options, std::uint64_t idle_limit_bytes)
      : table_(table),
        truth_(truth),
        images_(images),
        bulk_(bulk),
        counters_(counters),
        wake_(wake),
        options_(options),
        idle_limit_bytes_(idle_limit_bytes) {}

  // The body of one thread. Returns when the farm stops.
  void upkeep_loop();
  // Runs `change` while no upkeep of the job goes on, and forgets what upkeep remembers of it.
  void without(const std::string& job_id, const std::function<void()>& change);
  // The next round writes the images of all jobs.
  void flush_images();
  // Closes every film and writes the checkpoints that are due. Precondition: upkeep_loop() has returned.
  void last_checkpoints();

 private:
  // The memory of upkeep for one job; times are of the steady clock.
  struct State {
    double last_checkpoint = 0, retry_at = 0, last_image = 0;
    double last_estimate = 0, estimate_cost = 0;
    std::uint64_t estimated_iterations = 0;
    // The verdict on the last whole prefix. The scheduler may not have taken it yet.
    struct Looked {
      std::uint64_t version = 0;  // of the prefix's border; 0: none
      bool ends = false;
    } looked;
    double last_summary = 0;
    std::uint64_t summarized_segments = 0;
    std::string checkpoint_error, manifest_error;  // reported last; empty: none
  };

  void upkeep(const std::string& job_id, bool force) CANDELA_REQUIRES(mutex_);
  bool save_checkpoint(const std::string& job_id, JobFilm& film) CANDELA_REQUIRES(mutex_);
  void keep_manifest(const std::string& job_id) CANDELA_REQUIRES(mutex_);
  void estimate_error(const std::string& job_id, JobFilm& film, bool at_once) CANDELA_REQUIRES(mutex_);
  // Looks at prefixes that are whole. True: the job ends at one of them.
  bool look_at_prefixes(const std::string& job_id, JobFilm& film) CANDELA_REQUIRES(mutex_);
  struct Estimate {
    std::uint64_t iterations = 0;
    HalfSets merged;
    stats::ErrorInterval error;
  };
  // Nothing: there is no image, or it cannot be read. `history`: gets that of the film at the same moment.
  std::optional<Estimate> estimate(const std::string& job_id, JobFilm& film, ErrorHistory* history = nullptr)
      CANDELA_REQUIRES(mutex_);
  void summarize_chains(const std::string& job_id, JobFilm& film, bool at_once) CANDELA_REQUIRES(mutex_);
  void write_image(const std::string& job_id, JobFilm& film) CANDELA_REQUIRES(mutex_);

  JobTable& table_;
  JobTruth& truth_;
  ImageWriter& images_;
  BulkThreads& bulk_;
  FarmCounters& counters_;
  WakeSignal& wake_;
  const MasterOptions& options_;
  const std::uint64_t idle_limit_bytes_;

  std::atomic<bool> flush_requested_{false};
  Mutex mutex_;
  std::map<std::string, State> jobs_ CANDELA_GUARDED_BY(mutex_);
  JobFilm::Room room_ CANDELA_GUARDED_BY(mutex_);          // reused by the jobs one after another
  double room_used_ CANDELA_GUARDED_BY(mutex_) = 0;        // time of the last use
  double estimating_jobs_ CANDELA_GUARDED_BY(mutex_) = 1;  // in the present round, at least 1
  double idle_seconds_ CANDELA_GUARDED_BY(mutex_) =
      0;  // in the present round: before the film of an ended job leaves memory
};

}  // namespace candela::master
