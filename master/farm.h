// The master's heart: the scheduler under one lock, the films, the store, and the threads that keep them.
//
// Locks: `mutex_` guards the scheduler and the table of films and is never held across I/O or a film's lock;
// each film has its own; the store is written behind a queue. The services (master/api) are thin layers over
// this class.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "candela/v1/client.pb.h"
#include "candela/v1/job.pb.h"
#include "candela/v1/worker.pb.h"
#include "common/base/result.h"
#include "master/merge/job_film.h"
#include "master/merge/push_gate.h"
#include "master/merge/recent_images.h"
#include "master/options.h"
#include "master/scheduler/scheduler.h"
#include "master/store/blob_store.h"
#include "master/store/store.h"
#include "master/truth/job_truth.h"
#include "master/truth/manifest.h"

namespace candela::master {

// Counters since the start, for /metrics.
struct FarmCounters {
  static constexpr int kVerdicts = 7;  // index: v1::DeltaVerdict
  std::array<std::atomic<std::uint64_t>, kVerdicts> verdicts{};
  std::atomic<std::uint64_t> delta_bytes{0};
  std::atomic<std::uint64_t> queue_full{0};
  std::atomic<std::uint64_t> leases{0};
  std::atomic<std::uint64_t> checkpoints{0};
  std::atomic<std::uint64_t> checkpoint_failures{0};
  std::atomic<std::uint64_t> merge_microseconds{0};
  std::atomic<std::uint64_t> upload_bytes{0};
  std::atomic<std::uint64_t> damaged_blobs{0};
};

struct FarmOptions {
  MasterOptions master;
  FileWriter film_writer;         // empty: write_file_atomically
  double push_idle_seconds = 20;  // a sender of a delta silent for this long is cut off
};

class Farm {
 public:
  static Result<std::unique_ptr<Farm>> open(const FarmOptions& options);
  ~Farm();
  Farm(const Farm&) = delete;
  Farm& operator=(const Farm&) = delete;

  Now now() const;
  const FarmOptions& options() const { return options_; }
  BlobStore& blobs() { return *blobs_; }
  Store& store() { return *store_; }
  StoreWriter& writer() { return *writer_; }
  PushGate& gate() { return *gate_; }
  FarmCounters& counters() { return counters_; }
  JobTruth& truth() { return *truth_; }
  // Loaded or not (JobTruth::open_film loads it); null before the pilot and for unknown jobs.
  std::shared_ptr<JobFilm> film_of(const std::string& job_id);
  RecentImages& recent_images() { return recent_images_; }

  // Runs `f(scheduler)` under the lock, then hands its changes to the store's queue.
  template <class F>
  auto with_scheduler(F&& f) {
    struct Finally {  // changes leave under the lock: their order is the order of the decisions
      Farm& farm;
      ~Finally() { farm.publish(); }
    };
    const std::lock_guard lock(mutex_);
    const Finally finally{*this};
    return f(*scheduler_);
  }

  // --- clients ---
  struct Submitted {
    std::string job_id;
    bool existed = false;
  };
  // The settings, stop rule and bundle are validated already. ErrorKind::refused: the token names another
  // content.
  Result<Submitted> submit(JobRow row, const std::string& bundle_bytes);
  std::optional<v1::JobStatus> status(const std::string& job_id);
  std::vector<v1::JobStatus> all_status();
  std::vector<v1::WorkerStatus> all_workers();
  std::optional<v1::WorkerStatus> worker(const std::string& id);
  // pause, resume, cancel, extend: applied, written, and the status after.
  Result<v1::JobStatus> change_job(const std::string& job_id,
                                   const std::function<Result<void>(Scheduler&, Now)>& change);
  Result<v1::JobStatus> extend(const v1::ExtendJobRequest& request);
  Result<v1::JobStatus> resume(const std::string& job_id);
  // The image of what is merged now, as the bytes of an EXR file. ErrorKind::refused before the first merge.
  struct ImageParts {
    bool error_layer = false;
    bool image_only = false;    // without the job's further layers
    bool chain_layers = false;  // with what the image of a job of chains is made of
    bool partial = false;       // of a job that has lost samples: what is left
  };
  Result<std::string> image(const std::string& job_id, const ImageParts& parts);
  // A job that only its folder knew. Precondition: its row and bundle are in the store already.
  Result<void> take_in(Manifest manifest);
  Result<v1::GetLedgerResponse> ledger(const std::string& job_id);

  // --- leases ---
  // A lease for this worker with the inputs of its unit, if there is one. `describe` sees the lease and its
  // job under the scheduler's lock. ErrorKind::refused: the session is not known.
  Result<AcquireResult> acquire(const std::string& worker_id, const std::string& session,
                                const std::vector<std::string>& warm, bool prefetch,
                                const std::function<void(const Job&, const Lease&)>& describe);

  // --- blobs ---
  // The blob is missing, or was found damaged and set aside: an event and the message of each job that needs
  // it say so. The text is for the worker that asked.
  std::string blob_lost(const std::string& sha256, bool damaged);
  // The blob is there, whole. Jobs that waited for it go on.
  void blob_found(const std::string& sha256);

  // --- deltas ---
  struct Verdict {
    v1::DeltaVerdict verdict = v1::DELTA_VERDICT_UNSPECIFIED;
    std::string message;
  };
  // Before reading: a verdict if the delta need not be read at all. Errors: header fields, size.
  Result<std::optional<Verdict>> admit(const v1::DeltaHeader& header);
  // The whole delta is here: verify, decode, merge, remember.
  Verdict deliver(const v1::DeltaHeader& header, const std::string& bytes, double receive_seconds);

  // --- the end, and health ---
  bool stopping() const { return stopping_.load(); }
  void begin_stop();  // streams end; no more leases
  void stop();        // last checkpoints; idempotent
  void flush_images();
  std::string trouble();  // empty: healthy

 private:
  explicit Farm(const FarmOptions& options);
  Result<void> start();
  Result<void> lock_data_folder();
  Result<void> restore_jobs(StoredState state);
  void publish();  // precondition: mutex_ is held
  std::shared_ptr<JobFilm> make_film(const JobRow& row) const;
  // A job's film, read; its figures go into `row` and `restored`.
  struct RestoredFilm {
    std::shared_ptr<JobFilm> film;
    JobFilm::Account held;
    std::string trouble;  // of damaged checkpoints; empty: none
  };
  Result<RestoredFilm> restore_film(JobRow& row, RestoredChains& restored) const;
  v1::JobStatus status_locked(const Job& job, Now now) const;
  v1::WorkerStatus worker_locked(const WorkerState& worker, Now now) const;
  void warn_of_orphans(Now t);
  void log_event(const EventRow& event) const;
  std::filesystem::path job_folder(const std::string& job_id) const;
  Result<std::string> encode_image(const JobRow& row, const JobFilm::Snapshot& snapshot,
                                   const ImageParts& parts);

  void tick_loop();
  void keep_loop();
  void decide_loop();
  // Tells the film every state of its job, for the next checkpoint.
  void remember_states(const std::string& job_id, JobFilm& film);
  // The hash of the state; empty if it cannot be decided now and will be due again. Errors: the place.
  Result<std::optional<std::string>> decide_state(const DueDecision& due);
  void keep_job(const std::string& job_id, bool force);
  bool save_checkpoint(const std::string& job_id, JobFilm& film);
  void estimate(const std::string& job_id, JobFilm& film, bool now_please);
  void summarise_chains(const std::string& job_id, JobFilm& film, bool now_please);
  void write_image(const std::string& job_id, JobFilm& film);
  void sleep(double seconds);  // until then, or a wake-up

  const FarmOptions options_;
  int lock_fd_ = -1, folder_fd_ = -1;  // what keeps a second master out
  std::unique_ptr<Store> store_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<PushGate> gate_;
  std::unique_ptr<JobTruth> truth_;
  FarmCounters counters_;
  RecentImages recent_images_;
  std::unique_ptr<StoreWriter> writer_;

  mutable std::mutex mutex_;
  std::unique_ptr<Scheduler> scheduler_;
  std::map<std::string, std::shared_ptr<JobFilm>> films_;
  std::map<std::string, std::string> tokens_;  // idempotency token -> job id
  // Blobs that jobs have been told are lost: SHA-256, and whether by damage.
  std::map<std::string, bool> lost_blobs_;
  std::string store_trouble_;

  std::mutex submit_mutex_;  // one submission at a time

  // What the keeper knows of a job; its thread's (and stop()'s, after that thread has ended).
  struct Kept {
    double last_checkpoint = 0, retry_at = 0, last_image = 0;
    double last_estimate = 0, estimate_cost = 0;
    std::uint64_t estimated_iterations = 0;
    double last_summary = 0;
    std::uint64_t summarised_iterations = 0;
    std::string trouble, manifest_trouble;
  };
  std::map<std::string, Kept> kept_;
  std::mutex keep_mutex_;  // one keeper at a time (keep_loop, flush_images, stop)

  std::atomic<bool> stopping_{false}, stopped_{false}, flush_requested_{false};
  std::mutex wake_mutex_;
  std::condition_variable wake_;
  std::vector<std::thread> threads_;
};

// A random identifier: prefix and `characters` of base32 (lower case, no look-alikes), from the kernel's
// generator.
std::string random_id(std::string_view prefix, int characters);

}  // namespace candela::master
