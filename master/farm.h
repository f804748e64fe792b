// The master without its services: opens and closes its parts, takes submissions, hands out leases, tells the
// status.
//
// Parts and their locks (docs/decisions/023-one-lock.md): JobTable has the one lock of the scheduler and of
// the table of films; DeltaIntake merges deltas; JobUpkeep keeps checkpoints, estimates and manifests;
// EpochDecider decides the states of epochs; AuditKeeper looks for what distrusted workers have merged;
// ImageWriter encodes images; the store is written behind a queue. The services (master/api) are thin layers
// over this class.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "master/jobs/audit_keeper.h"
#include "master/jobs/delta_intake.h"
#include "master/jobs/epoch_decider.h"
#include "master/jobs/farm_counters.h"
#include "master/jobs/image_writer.h"
#include "master/jobs/job_status.h"
#include "master/jobs/job_table.h"
#include "master/jobs/job_upkeep.h"
#include "master/jobs/retention.h"
#include "master/jobs/wake_signal.h"
#include "master/merge/push_gate.h"
#include "master/options.h"
#include "master/scheduler/scheduler.h"
#include "master/store/blob_store.h"
#include "master/store/store.h"
#include "master/truth/job_truth.h"
#include "master/truth/manifest.h"

namespace candela::master {

struct FarmOptions {
  MasterOptions master;
  FileWriter film_writer;         // empty: write_file_atomically
  ChangeListener listener;        // empty: nobody listens
  double push_idle_seconds = 20;  // a sender of a delta silent for this long is cut off
};

// Added to the stop rule of a job.
struct Extension {
  std::uint64_t iterations = 0;
  double time_seconds = 0;
  double relmse = 0;
  std::string token = {};  // two calls with one token extend once; empty: none
};

// An action on all frames of a group.
struct GroupAction {
  enum class Kind : std::uint8_t { pause, resume, cancel, priority, extend };
  Kind kind = Kind::pause;
  std::int32_t priority = 0;
  Extension extension = {};
};

// The merged units of a job and the film's own account of them, for audits.
struct Ledger {
  // Sequence indices of one half.
  struct Range {
    std::uint32_t half = 0;
    std::uint64_t begin = 0, end = 0;
  };
  std::vector<UnitRow> merged;         // from the store
  std::vector<Range> film;             // from the merged film itself
  std::uint64_t film_eye_samples = 0;  // the film's own count
  std::uint64_t chain_segments = 0;    // of a job of chains: by the records of its chains
};

class Farm final : public TruthFarm {
 public:
  static Result<std::unique_ptr<Farm>> open(const FarmOptions& options);
  ~Farm() override;
  Farm(const Farm&) = delete;
  Farm& operator=(const Farm&) = delete;

  Now now() const override { return JobTable::now(); }
  const FarmOptions& options() const { return options_; }
  const std::filesystem::path& data_folder() const override { return options_.master.data_dir; }
  BlobStore& blobs() override { return *blobs_; }
  Store& store() override { return *store_; }
  StoreWriter& writer() override { return *writer_; }
  PushGate& gate() { return *gate_; }
  FarmCounters& counters() { return counters_; }
  JobTruth& truth() { return *truth_; }
  DeltaIntake& deltas() { return *deltas_; }
  ImageWriter& images() { return *images_; }
  // Loaded or not (JobTruth::open_film loads it); null before the pilot and for unknown jobs.
  std::shared_ptr<JobFilm> film_of(const std::string& job_id) override { return table_->film_of(job_id); }
  void use_scheduler(const std::function<void(Scheduler&)>& use) override { table_->with_scheduler(use); }

  // Runs `f(scheduler)` under the lock, then hands its changes to the store's queue.
  template <class F>
  auto with_scheduler(F&& f) {
    return table_->with_scheduler(std::forward<F>(f));
  }

  // --- clients ---
  struct Submitted {
    std::string job_id;
    bool existed = false;
  };
  // The settings, stop rule and bundle are validated already. ErrorKind::refused: the token names another
  // content.
  Result<Submitted> submit(JobRow row, const std::string& bundle_bytes);
  std::optional<JobStatus> status(const std::string& job_id);
  // The same, with the report of its decided states.
  std::optional<JobStatus> full_status(const std::string& job_id);
  // That report, with what the job's merges tell; nothing: no state has been decided.
  std::optional<EpochStatus> epoch_status(const std::string& job_id);
  std::vector<JobStatus> open_status();  // of jobs that have not ended
  std::vector<WorkerStatus> all_workers();
  std::optional<WorkerStatus> worker(const std::string& id);
  // pause, resume, cancel, extend: applied, written, and the status after. If it cannot be written the change
  // holds all the same while this master runs, and is written later: the status says so. `refuse_unwritable`:
  // such a change is not made. Errors (resource) come before any change.
  Result<JobStatus> change_job(const std::string& job_id,
                               const std::function<Result<void>(Scheduler&, Now)>& change,
                               bool refuse_unwritable = false);
  Result<void> change(const std::string& job_id,
                      const std::function<Result<void>(Scheduler&, Now)>& change) override;
  Result<JobStatus> extend(const std::string& job_id, const Extension& extension);
  Result<JobStatus> resume(const std::string& job_id);
  // Groups: farm_groups.cpp. Frames that cannot be changed stay as they are; if none can, the error is that
  // of the first.
  Result<GroupStatus> steer_group(const std::string& group_id, const GroupAction& action);
  std::optional<GroupStatus> group_status(const std::string& group_id);
  // The id of the group that this submitter's token means.
  static std::string group_id_of(const std::string& submitter, const std::string& token);
  // A job that only its folder knew. Precondition: its row and bundle are in the store already.
  Result<void> take_in(Manifest manifest) override;
  Result<Ledger> ledger(const std::string& job_id);

  // --- leases ---
  // A lease for this worker with the inputs of its unit, if there is one. `describe` sees the lease and its
  // job under the scheduler's lock. ErrorKind::refused: the session is not known.
  Result<AcquireResult> acquire(const std::string& worker_id, const std::string& session,
                                const std::vector<std::string>& warm, LeaseWish wish,
                                const std::function<void(const Job&, const Lease&)>& describe);

  // Bytes that all jobs may take of this process's memory, and of those their statistics.
  std::uint64_t memory_limit() const { return memory_limit_; }
  std::uint64_t statistics_limit() const { return statistics_limit_; }

  // --- blobs ---
  // The blob is missing, or was found damaged and set aside: an event and the message of each job that needs
  // it say so. The text is for the worker that asked.
  std::string blob_lost(const std::string& sha256, bool damaged) override;
  // The blob is there, whole. Jobs that waited for it go on.
  void blob_found(const std::string& sha256);

  // --- the end, and health ---
  bool stopping() const override { return wake_.stopping(); }
  void begin_stop() { wake_.stop(); }  // streams end; no more leases
  void stop();                         // last checkpoints; idempotent
  void flush_images() { upkeep_->flush_images(); }
  std::string trouble();  // empty: healthy

 private:
  explicit Farm(const FarmOptions& options);
  Result<void> start();
  Result<void> lock_data_folder();
  void tighten_data_folder() const;
  Result<void> restore_jobs(StoredState state);
  // A job's film, read; its figures go into `row` and `restored`.
  struct RestoredFilm {
    std::shared_ptr<JobFilm> film;
    JobFilm::Account held;
    std::string trouble;  // of damaged checkpoints; empty: none
  };
  Result<RestoredFilm> restore_film(JobRow& row, RestoredStages& restored) const;
  void warn_of_orphans();
  // The id of the job that was submitted with the same token; otherwise nothing, and `row` has a new id.
  // Precondition: called inside with_scheduler().
  Result<std::optional<std::string>> choose_id(const Scheduler& s, JobRow& row) const;
  // A new job's dependencies are there, and it gets its group's priority and share.
  Result<void> place_in_group(const Scheduler& s, JobRow& row) const;
  // Precondition: called inside with_scheduler().
  void remember_extension(const std::string& token);
  void start_thread(const char* what, std::function<void()> loop);
  void tick_loop();

  const FarmOptions options_;
  const std::uint64_t memory_limit_, statistics_limit_;
  int lock_fd_ = -1, folder_fd_ = -1;  // keep a second master out
  std::unique_ptr<Store> store_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<PushGate> gate_;
  FarmCounters counters_;
  WakeSignal wake_;
  std::unique_ptr<StoreWriter> writer_;
  std::unique_ptr<JobTable> table_;
  std::unique_ptr<JobTruth> truth_;
  std::unique_ptr<BulkThreads> merging_, keeping_;
  std::unique_ptr<DeltaIntake> deltas_;
  std::unique_ptr<StateReports> reports_;
  std::unique_ptr<ImageWriter> images_;
  std::unique_ptr<EpochDecider> decider_;
  std::unique_ptr<JobUpkeep> upkeep_;
  std::unique_ptr<Retention> retention_;
  std::unique_ptr<AuditKeeper> audits_;

  // Guarded by the table's lock: used inside with_scheduler() alone.
  std::map<std::string, std::string> tokens_;  // idempotency token -> job id
  std::deque<std::string> extensions_;         // idempotency tokens of the latest calls of extend()
  // Blobs that jobs have been told are lost: SHA-256, and whether by damage.
  std::map<std::string, bool> lost_blobs_;

  Mutex submit_mutex_;  // one submission at a time; held across I/O

  Mutex health_mutex_;
  std::string store_trouble_ CANDELA_GUARDED_BY(health_mutex_);

  std::atomic<bool> stopped_{false};
  std::vector<std::thread> threads_;
};

// A random identifier: prefix and `characters` of base32 (lower case, no look-alikes), from the kernel's
// generator.
std::string random_id(std::string_view prefix, int characters);
// An identifier of that form made of the first digits of a hash.
std::string id_from(std::string_view prefix, std::string_view hex_digits);

}  // namespace candela::master
