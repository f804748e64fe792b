// The worker's threads and what they share. Control registers, acquires leases and reports; heartbeat keeps
// the leases alive; render runs units; push encodes and delivers them. All shared state is behind
// one mutex that is never held during a call, a render or file access.
//
//   control --pending--> render --outbox--> push
//
// At most one lease is waiting, one unit is rendered and one is pushed. A finished delta stays in the outbox
// until the master gives its verdict or the lease is lost. A worker whose deltas all wait, since the master's
// queue is full, takes one unit more if its job is more urgent than theirs.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/work_monitor.h"
#include "common/film/delta.h"
#include "worker/service/master_link.h"
#include "worker/service/scene_store.h"
#include "worker/service/worker_service.h"

namespace candela::worker {

// Finished deltas that a worker holds; one more of an urgent job.
inline constexpr std::size_t kMaxDeltas = 2;

// Times and bounds; tests shorten them.
struct Tuning {
  Milliseconds first_backoff{100};
  // A master that restarts is back in seconds: its workers must not sleep longer.
  Milliseconds longest_backoff{2000};
  Milliseconds call_deadline{5000};  // of a unary call
  Milliseconds register_deadline{10000};
  Milliseconds finish_within{2000};  // a draining worker finishes an iteration this near to its end
  Milliseconds cut_within{10000};    // so does one that is asked to cut a unit short, as a rule
  Milliseconds block{500};           // of iterations, after each of which a unit can be cut
  // A renderer that does not end so long after it was told to never will: the process begins again.
  Milliseconds stop_limit{10000};
  Milliseconds drain_limit{20000};       // and delivers for at most this long
  Milliseconds farewell_deadline{2000};  // of each last call
  // Limit for one delta; a rejection is neither a verdict nor a reason to wait.
  unsigned max_push_rejections = 20;
  std::size_t max_scenes = 4;
};

class FarmWorker final : public Worker {
 public:
  using Clock = std::chrono::steady_clock;

  static Result<std::unique_ptr<Worker>> start(const WorkerOptions& options,
                                               std::shared_ptr<grpc::Channel> channel,
                                               RendererFactory factory, const Tuning& tuning = {});
  ~FarmWorker() override;
  void drain() override;
  Result<void> wait() override;
  bool must_begin_again() const override;

 private:
  struct Session {
    std::string worker_id, token;
    std::uint64_t generation = 0;  // 0: not registered
    Milliseconds heartbeat{1000};
    std::size_t chunk_bytes = 1 << 18;
  };
  // A lease and how its unit stands. `dropped`: the worker does not own it any more, nothing of it may be
  // delivered.
  struct Task {
    v1::Lease lease;
    std::uint64_t generation = 0;  // of the session it was leased under
    bool urgent = false;           // of higher priority than the deltas that waited when it was leased
    WorkMonitor monitor;           // stopped if dropped
    std::atomic<bool> dropped{false};
    std::atomic<bool> cut{false};  // ends after the block of iterations, or the segments, under way
    // Under the lock.
    Clock::time_point started{};
    Clock::time_point block_started{};
    std::optional<Clock::time_point> cut_at, stopped_at;
    // Parts of the unit that were rendered before the block under way, and that are in it.
    double before_block = 0, of_block = 1;
    std::atomic<float> progress{0};  // of the block
    double fraction() const { return before_block + of_block * std::clamp<double>(progress, 0, 1); }
    WorkPhase phase() const { return monitor.phase.load(std::memory_order_relaxed); }
  };
  using TaskPtr = std::shared_ptr<Task>;
  // Sums to add into, kept from unit to unit.
  struct Sums {
    std::string scene_key;
    NamedState state;  // that they were made for
    render::UnitOutput output;
  };
  struct Finished {
    TaskPtr task;
    Sums sums;
    film::DeltaInfo info;
    double render_seconds = 0;
    // Delivery; only the push thread writes it, but for `not_before`.
    std::string bytes;  // empty: not encoded yet
    std::optional<v1::DeltaHeader> header;
    std::optional<Backoff> backoff;
    unsigned rejections = 0;
    Clock::time_point not_before{};  // the master could not take it: others go first
  };
  // Message to the master about a unit that will not be delivered.
  struct Notice {
    std::uint64_t token = 0, generation = 0;
    bool failed = false;  // else handed back
    bool computing = false;
    FailureCause cause = FailureCause::worker;
    std::string message;
  };

  FarmWorker(const WorkerOptions& options, std::shared_ptr<grpc::Channel> channel, RendererFactory factory,
             std::unique_ptr<BlobCache> cache, const Tuning& tuning);

  // farm_worker.cpp: control and heartbeat
  void control_loop();
  void register_once(Lock& lock) CANDELA_REQUIRES(mutex_);
  void acquire_once(Lock& lock) CANDELA_REQUIRES(mutex_);
  void send_notice(Lock& lock) CANDELA_REQUIRES(mutex_);
  bool step_drain() CANDELA_REQUIRES(mutex_);
  void cut_short(const TaskPtr& task) CANDELA_REQUIRES(mutex_);
  void settle_cut() CANDELA_REQUIRES(mutex_);
  std::optional<double> seconds_left(const Task& task) const CANDELA_REQUIRES(mutex_);
  bool is_stuck() CANDELA_REQUIRES(mutex_);
  void leave(Lock& lock) CANDELA_REQUIRES(mutex_);
  void heartbeat_loop();
  void note_contact(const grpc::Status& status) CANDELA_REQUIRES(mutex_);
  void give_up_if_due() CANDELA_REQUIRES(mutex_);
  void lose_session(std::uint64_t generation) CANDELA_REQUIRES(mutex_);
  void drop(Task& task, std::string_view why) CANDELA_REQUIRES(mutex_);
  void hand_back(const TaskPtr& task) CANDELA_REQUIRES(mutex_);
  void end_with(Error error) CANDELA_REQUIRES(mutex_);
  bool owns(std::uint64_t token) const CANDELA_REQUIRES(mutex_);
  bool wants_lease() const CANDELA_REQUIRES(mutex_);
  // Its deltas wait for the master: only an urgent unit is wanted.
  bool is_full() const CANDELA_REQUIRES(mutex_);

  // farm_worker_render.cpp
  void render_loop();
  void render_task(const TaskPtr& task);
  void run_task(const TaskPtr& task);
  void run_pilot(const TaskPtr& task, const SceneStore::Scene& scene);
  void run_unit(const TaskPtr& task, const SceneStore::Scene& scene, const Unit& unit,
                const NamedState& state);
  // Renders the unit, or less of it if it is cut short: `unit` is then what was rendered.
  Result<void> run_blocks(const TaskPtr& task, const SceneStore::Scene& scene, const render::UnitInput& input,
                          Unit& unit, render::UnitOutput& output);
  void fail(const TaskPtr& task, const Error& error);  // of the renderer
  void fail(const TaskPtr& task, FailureCause cause, const std::string& message);
  // Fetches blobs for the task, again and again while the master is away.
  BlobCache::Fetch fetch_for(const TaskPtr& task);
  // The bytes of the states that the lease names, which `owners` keeps. False: the task was failed or
  // stopped.
  bool fetch_states(const TaskPtr& task, render::UnitInput& input, std::vector<BlobCache::Mapped>& owners);
  std::shared_ptr<const SceneStore::Scene> scene_for(const TaskPtr& task, const JobSettings& settings);
  Sums take_sums(const SceneStore::Scene& scene, const Unit& unit, const NamedState& state);
  void keep_sums(Sums sums);

  // farm_worker_push.cpp
  void push_loop();
  // One attempt. False: it is to be pushed again, not before finished.not_before.
  bool deliver(Finished& finished);
  bool deliver_bytes(Finished& finished);

  // Repeats `call` while the master is unreachable and the task is ours. The last status; CANCELLED if it was
  // given up.
  grpc::Status persist(const TaskPtr& task, const std::function<grpc::Status()>& call);
  // False at once if the task is dropped, else true after the delay.
  bool pause_for(const TaskPtr& task, Milliseconds delay);
  Session session_now() const;

  const WorkerOptions options_;
  const Tuning tuning_;
  const unsigned threads_;
  const std::string host_, name_;
  RendererFactory factory_;
  std::unique_ptr<BlobCache> cache_;
  SceneStore scenes_;
  MasterLink link_;

  mutable Mutex mutex_;
  std::condition_variable changed_;  // anything below
  Session session_ CANDELA_GUARDED_BY(mutex_);
  std::uint64_t generations_ CANDELA_GUARDED_BY(mutex_) = 0;
  std::deque<TaskPtr> pending_ CANDELA_GUARDED_BY(mutex_);
  TaskPtr running_ CANDELA_GUARDED_BY(mutex_);
  std::deque<std::shared_ptr<Finished>> outbox_
      CANDELA_GUARDED_BY(mutex_);  // the front one is pushed, or was last
  std::deque<Notice> notices_ CANDELA_GUARDED_BY(mutex_);
  std::vector<Sums> spare_sums_ CANDELA_GUARDED_BY(mutex_);
  Clock::time_point next_acquire_ CANDELA_GUARDED_BY(mutex_){};
  bool asked_while_busy_ CANDELA_GUARDED_BY(mutex_) = false;
  enum class Drain { no, by_master, by_us };
  Drain drain_ CANDELA_GUARDED_BY(mutex_) = Drain::no;
  Clock::time_point drain_started_ CANDELA_GUARDED_BY(mutex_){};
  bool running_settled_ CANDELA_GUARDED_BY(mutex_) =
      false;  // the draining decision on the running unit is made
  bool beat_soon_ CANDELA_GUARDED_BY(mutex_) =
      false;                                       // the master waits to hear that a stopped unit has ended
  bool stuck_ CANDELA_GUARDED_BY(mutex_) = false;  // the renderer does not stop
  std::optional<Clock::time_point> unreachable_since_ CANDELA_GUARDED_BY(mutex_);
  bool closing_ CANDELA_GUARDED_BY(mutex_) = false;  // threads end
  bool ended_ CANDELA_GUARDED_BY(mutex_) = false;    // wait() returns
  std::optional<Error> end_error_ CANDELA_GUARDED_BY(mutex_);
  Backoff control_backoff_;

  std::thread heartbeat_thread_, render_thread_, push_thread_, control_thread_;
};

}  // namespace candela::worker
