// Leases of units to workers, with fencing tokens: units cut to size, priorities and fair shares, failures,
// stop rules.
//
// Pure logic: no I/O, no threads, no clock of its own. Every call is told the time; the caller holds one lock
// around all calls. What is to be remembered comes out as changes for the store, in order (take_changes()).
//
// A job passes through stages (unit_source.h): the pilot, of a job of Markov chains the bootstrap, and the
// film. The scheduler asks the source of the present stage for units and knows no kind of work.
//
// A unit is open, leased (once, or twice if it is a straggler's) or merged; merged units live on only as the
// set of merged indices. Exactly-once counting is the film's: it refuses an index that it has. The
// scheduler's tokens keep out those who lost their lease.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/work_monitor.h"
#include "common/film/index_set.h"
#include "common/stages/memory_need.h"
#include "master/scheduler/audit.h"
#include "master/scheduler/failure.h"
#include "master/scheduler/index_sets.h"
#include "master/scheduler/scheduler_state.h"
#include "master/scheduler/unit_source.h"
#include "master/store/records.h"

namespace candela::master {

struct SchedulerOptions {
  double lease_seconds = 30;
  double unit_seconds = 4;
  FailurePolicy failures;
  // A worker loses a unit that it has computed on so long without a step. Long enough for anything that does
  // go on, such as reading a texture of gigabytes from a slow disk.
  double stuck_seconds = 600;
  double forget_worker_seconds = 3600;  // a lost worker's session ends
  // So does, sooner, that of one that never merged or failed a unit: a program that crashes as soon as it has
  // registered.
  double forget_idle_worker_seconds = 60;
  // Rendering, prefetched, and finished ones waiting for their verdict.
  std::size_t max_leases_per_worker = 6;
  std::size_t max_workers = 10000;
  std::size_t max_jobs = 100000;
  // Share of units that another worker renders, too; 0: none, not even those of new workers.
  double audit_share = 0;
  std::uint64_t audit_secret = 0;
  // Bytes of the master's memory that all admitted jobs may take, and of them those for statistics. 0: no
  // limit.
  std::uint64_t memory_bytes = 0;
  std::uint64_t statistics_bytes = 0;
};

// From so many workers on the scheduler does not look at all of them at each occasion.
inline constexpr std::size_t kManyWorkers = 64;

// Request of a worker for a lease.
struct LeaseWish {
  bool prefetch = false;  // it is still rendering another unit
  bool full = false;      // its deltas wait: only a unit of higher priority than all that it holds
};

struct AcquireResult {
  std::optional<Lease> lease;
  UnitInput input;                   // of the lease's unit
  std::vector<std::string> unread;   // jobs whose units were not offered, since their films are not in memory
  std::vector<std::string> lacking;  // jobs whose films do not hold what some unit starts from
  std::uint32_t retry_ms = 0;
  bool drain = false;
};
struct HeartbeatResult {
  std::vector<std::uint64_t> revoked;
  std::vector<std::uint64_t> cut;
  bool drain = false;
};
enum class Delivery { ok, duplicate, stale, job_ended };

// A job's chains and epochs, as the store and the film keep them.
struct RestoredStages {
  std::vector<BootstrapRow> bootstrap;  // of one that is not complete
  std::vector<std::uint64_t> starts;    // else these
  std::size_t record_bytes = 0;         // of the largest record in the film
  std::vector<StateRow> states = {};    // of epochs 0, 1, ...
};

// The threads and workers that the open jobs could use now, those at work included.
struct Wanted {
  std::uint64_t threads = 0;
  std::uint64_t workers = 0;  // with as many threads as the present ones have on average
};

// A job of epochs that has not ended.
struct EpochJob {
  std::string job_id;
  std::uint64_t states = 0;  // number of states that are decided
  bool due = false;          // the next one can and must be decided: all that it depends on is merged
};

class Scheduler {
 public:
  Scheduler(const SchedulerOptions& options, std::uint64_t epoch, std::uint64_t next_unit_id);

  // --- jobs ---
  void submit(JobRow row, Now now);
  // A job from the store, with what its film holds. `merged` rows and `unmerged` rows are reconciled with the
  // film: a row the film does not have is open again, a unit the film has is merged, gaps become new units.
  // For a job that has ended nothing is opened; what its rows tell and its film lacks is lost (Job::lost).
  void restore(JobRow row, const std::array<film::IndexSet, 2>& film, const film::SampleCounts& sample_counts,
               std::vector<UnitRow> unmerged, std::vector<UnitRow> merged, Now now,
               const RestoredStages& restored = {});
  // A job that the store did not know, with what its folder tells (JobTruth::repair).
  void adopt(JobRow row, const HalfSets& film, const film::SampleCounts& sample_counts,
             const RestoredStages& chains, Now now);
  // The film of a known job was read and does not hold what `merged` rows tell. As restore(), for one job of
  // a running master. `generation` is the newest on disk; `trouble` says what is wrong with the checkpoints,
  // if anything.
  void reconcile(const std::string& id, const HalfSets& film, const film::SampleCounts& sample_counts,
                 std::vector<UnitRow> merged, std::uint64_t generation, const std::string& trouble, Now now);
  // Leases of the store, after all jobs and workers are back: each gets a fresh expiry.
  void restore_lease(const LeaseRow& row, Now now);
  void restore_worker(const WorkerRow& row, Now now);

  const std::map<std::string, Job>& jobs() const { return jobs_; }
  // By id; none is empty.
  const std::map<std::string, GroupState>& groups() const { return groups_; }
  // Why a job cannot wait for this job or group: there is none, it has failed or was cancelled (refused).
  Result<void> check_dependency(const std::string& id) const;
  const Job* job(const std::string& id) const;
  Result<void> pause(const std::string& id, Now now);
  Result<void> resume(const std::string& id, Now now);
  Result<void> cancel(const std::string& id, Now now);
  Result<void> extend(const std::string& id, std::uint64_t iterations, double seconds, double relmse,
                      Now now);
  // Leases of units that are under way stay.
  Result<void> set_priority(const std::string& id, std::int32_t priority, Now now);
  // Opens what an ended job has lost, and nothing else. When the film has it all the job is again what it
  // was. False: nothing is lost, and nothing changes. Errors: the job has not ended.
  Result<bool> repair(const std::string& id, Now now);
  // The final checkpoint of a finishing job is on disk.
  void finish(const std::string& id, Now now);
  void fail_job(const std::string& id, const std::string& message, Now now);
  // For people: what ends a job is its prefixes.
  void relmse_estimated(const std::string& id, double relmse, double upper);

  // --- stops by error: scheduler_prefixes.cpp ---
  // A prefix whose indices are all merged. Nothing: the job has none now, or does not end by its error.
  struct WholePrefix {
    std::uint64_t rounds = 0;
    PrefixBorder border;
    PrefixBorder next;    // the film's, before prefix_decided() says that the job goes on
    double relmse = 0;    // of the stop rule
    bool may_end = true;  // nothing that the job has lost is beyond it
    bool chains = false;  // of what the schedule is
  };
  std::optional<WholePrefix> whole_prefix(const std::string& id) const;
  // The error at this prefix is known. True: the job ends there, and what is merged beyond is no part of it.
  // The prefix stays for now if the job must not end, and if a rule that has changed in the meantime may not
  // end it.
  bool prefix_decided(const std::string& id, const WholePrefix& prefix, bool ends, Now now);
  // Counts of the film, after it dropped what was ahead.
  void recount(const std::string& id, const film::SampleCounts& sample_counts, Now now);
  void checkpointed(const std::string& id, std::uint64_t generation, std::uint64_t iterations, Now now);
  void set_note(const std::string& id, const std::string& note);

  // --- memory ---
  // The system has too little for the job's film, whatever was counted: the job waits for some seconds.
  void lack_memory(const std::string& id, const std::string& text, Now now);
  // Some job waits for memory.
  bool short_of_memory() const { return short_of_memory_; }

  // The removal of an ended job, in three steps. withdraw(): it leaves jobs(), and nothing changes it any
  // more; false: it has not ended, or not at this moment. forget(): the store drops it, an event says `text`.
  // put_back(): it stays after all. job() finds a withdrawn job for another hour, for calls under way.
  bool withdraw(const std::string& id, std::int64_t finished_unix_ms, Now now);
  void put_back(const std::string& id);
  void forget(const std::string& id, const std::string& text, Now now);

  // --- workers ---
  Result<void> register_worker(WorkerRow row, Now now);
  // The worker of this id and session, seen now; null if there is none.
  WorkerState* authenticate(const std::string& id, const std::string& session, Now now);
  const std::map<std::string, WorkerState>& workers() const { return workers_; }
  Result<void> drain(const std::string& worker_id, Now now);
  // A paused worker keeps its session and is offered nothing. Its units are cut short. The pause is that of
  // its name on its host: it outlives the worker's process.
  Result<void> pause_worker(const std::string& worker_id, Now now);
  Result<void> resume_worker(const std::string& worker_id, Now now);
  void deregister(const std::string& worker_id, Now now);
  std::string worker_state_name(const WorkerState& worker, Now now) const;
  // Reason that keeps the worker from going on; empty: none.
  std::string stuck_text(const WorkerState& worker, Now now) const;

  // --- the cycle of a unit ---
  // A lease comes with the inputs of its unit, in one decision. A unit whose inputs are missing is not
  // offered: it waits, the job says so, and other units and jobs go on. `films`: where the inputs are; null
  // where no job needs any.
  AcquireResult acquire(const std::string& worker_id, const std::vector<std::string>& warm, LeaseWish wish,
                        Now now, const FilmInputs* films = nullptr);
  HeartbeatResult heartbeat(const std::string& worker_id, const std::vector<UnitReport>& units, Now now);
  // computing: it takes the worker a moment to stop.
  void return_lease(const std::string& worker_id, std::uint64_t token, Now now, bool computing = false);
  // Idempotent per token. failure.h has what follows.
  void fail_unit(const std::string& worker_id, std::uint64_t token, FailureCause cause,
                 const std::string& message, Now now);
  // The master itself cannot give what the unit of this lease starts from. The unit waits; neither the worker
  // nor the job's other units do.
  void lack_inputs(const std::string& worker_id, std::uint64_t token, const std::string& message, Now now);
  // The master has lost a blob that the job needs; `text` says which, and the mend. True if that is news.
  bool lack_blob(const std::string& job_id, const std::string& sha256, const std::string& text, Now now);
  // It has it again: jobs that waited for it go on.
  void blob_arrived(const std::string& sha256, Now now);
  // The job of a lease that this worker holds; null if it holds none of this token.
  const Job* job_of_lease(const std::string& worker_id, std::uint64_t token) const;
  // Precondition: validate(result.work) holds for the job's size.
  bool complete_pilot(const std::string& worker_id, std::uint64_t token, const PilotResult& result, Now now);
  // False for a stale token. Fails (input) if the result is not of the lease's samples.
  Result<bool> complete_bootstrap(const std::string& worker_id, std::uint64_t token,
                                  std::vector<float> contributions,
                                  const std::array<std::uint64_t, film::kRejectCauses>& rejected,
                                  double render_seconds, Now now);
  // May this delta be merged? Asked before reading and again before merging. It may have fewer iterations
  // than its lease, from the first one on; merged() has the others leased anew.
  Delivery check_delivery(const std::string& worker_id, std::uint64_t token, std::uint64_t unit_id,
                          const std::string& job_id, const Unit& unit, Now now);
  // Extends a lease (a delivery in progress counts as a sign of life).
  void touch_lease(std::uint64_t token, Now now);
  // The film has it. Also when the lease went away in the meantime: the film decides.
  void merged(const std::string& worker_id, std::uint64_t token, std::uint64_t unit_id,
              const std::string& job_id, const Unit& unit, const film::SampleCounts& sample_counts,
              double render_seconds, double overhead_seconds, Now now, std::size_t record_bytes = 0,
              double merge_seconds = 0, const std::string& sha256 = {});
  // The bootstrap found nothing, nor did anything else in a round of all chains.
  void found_black(const std::string& id, Now now);
  // Takes the film's records as they are now, and how long chains have stayed.
  void chains_summarised(const std::string& id, const chains::Summary& summary, Now now);

  // --- audits ---
  // Decides on a delta. Precondition: check_delivery() says ok at this moment.
  Reception receive(const Delivered& delivered, Now now);
  const std::map<std::string, DistrustRow>& distrusted() const { return distrusted_; }
  const AuditCounts& audit_counts() const { return audit_counts_; }
  void restore_distrust(const DistrustRow& row);  // before jobs and workers
  // `word`: a worker's id, its identity, or its name. It may have left, if it brought something that a job or
  // `makers` tell of.
  Result<DistrustRow> distrust(const std::string& word, Now now, const std::vector<MakerRow>& makers = {});
  // `word`: likewise, of one that is distrusted.
  Result<DistrustRow> trust(const std::string& word, Now now);
  // Each worker to be tainted is told once.
  AuditWork audit_work();
  // `rows`: the job's merged units, all that were merged before audit_work() gave `doubts`. Those that a
  // distrusted worker brought are rendered again, or the job begins anew.
  void doubt(const std::string& id, std::uint64_t doubts, const std::vector<UnitRow>& rows, Now now);
  // The job's film is gone.
  void begin_anew(const std::string& id, Now now);
  // `units`: of the worker, by job.
  void taint(const std::string& who, const std::map<std::string, std::uint64_t>& units,
             const std::set<std::string>& only, Now now);
  // Text about a dispute that nobody has decided; empty: there is none.
  std::string dispute_text(const Job& job) const;

  // --- epochs ---
  std::vector<EpochJob> epoch_jobs() const;
  // True if this is the state of its epoch, as far as one is known. If it is not, the job fails: the sums
  // have changed.
  bool agrees(const StateRow& row, Now now);
  // The state of an epoch is decided, and its bytes are in the blob store. No effect unless it agrees and is
  // the next one.
  void decided(const StateRow& row, Now now);
  // The bytes of a state are lost: it, and those after it, come from the film or are decided anew. False: no
  // job has such a state.
  bool lost_state(const std::string& sha256, Now now);

  // Expiries, time limits, workers that came back or got lost. Call it a few times a second.
  void tick(Now now);

  void event(Now now, const std::string& job, const std::string& worker, const std::string& kind,
             const std::string& message);
  std::vector<Change> take_changes();

  // --- figures for status ---
  std::size_t leases_of(const std::string& job_id) const;
  // Number of workers that have units of some of these jobs.
  std::size_t workers_of(const std::set<std::string>& job_ids) const;
  // The shortest prefix of the id, of at least five characters, that no other job or group has.
  std::string short_id(const std::string& id) const;
  std::set<std::string> jobs_of(const WorkerState& worker) const;
  std::size_t lease_count() const { return leases_.size(); }
  std::uint64_t expired_count() const { return expired_count_; }
  double samples_per_second(const Job& job, Now now) const;
  // The resident memory of a worker's process, as its last heartbeat told; 0: unknown.
  void note_memory(const std::string& worker_id, std::uint64_t resident_bytes);
  // The largest of those that have leases of the job.
  std::uint64_t worker_memory_of(const std::string& job_id) const;
  double indices_per_second(const Job& job, Now now) const;
  double eta_seconds(const Job& job, Now now) const;  // NaN where unknown
  // Threads that the open jobs could use now such that each has at least a unit's time of work; of a job
  // whose cost nobody knows yet, one worker's; of each open job at least one. At most as many workers as the
  // farm admits. While no worker is there, nobody knows how many threads one has: then one worker is wanted.
  Wanted wanted(Now now) const;
  std::string message_of(const Job& job, Now now) const;
  std::optional<Waiting> waiting_of(const Job& job, Now now) const;
  const FailureCounts& failures() const { return failures_; }

 private:
  friend class SchedulerInvariants;  // invariants.cpp
  friend class SchedulerPlants;      // tests: violations planted behind the scheduler's back

  double lost_after() const { return std::max(options_.lease_seconds, 10.0); }  // seconds of silence
  // It lives, and has units or asks for some. One that only says that it lives is nobody to wait for.
  bool takes_part(const WorkerState& worker, Now now) const;
  bool usable(const WorkerState& worker, Now now) const;
  bool can_run(const WorkerState& worker, const std::string& isa) const;
  bool can_run(const WorkerState& worker, const Job& job) const {
    return can_run(worker, job.row.settings.isa);
  }
  // The count of many workers may be a quarter of a second old, unless one came, left or changed since.
  std::uint64_t active_workers(const Job& job, Now now);
  std::vector<Job*> candidates(const WorkerState& worker, const std::vector<std::string>& warm, Now now);
  UnitState* pick(Job& job, const WorkerState& worker, bool prefetch, Now now);
  bool has_work(const Job& job, const WorkerState& worker, Now now) const;
  // Puts the unit's inputs into `out`. False: they are missing, and `out` and the job say so.
  bool gather_input(Job& job, UnitState& unit, const FilmInputs* films, AcquireResult& out, Now now);
  // Leases a unit of the job, if it has one for this worker.
  bool lease_unit(Job& job, WorkerState& worker, bool prefetch, const FilmInputs* films, AcquireResult& out,
                  Now now);
  double expected_seconds(const Job& job, const WorkerState& worker, const Unit& unit) const;
  void bootstrapped(Job& job, Now now);
  void restore_chains(Job& job, const RestoredStages& restored, Now now);
  static void restore_states(Job& job, const std::vector<StateRow>& states);
  static void rebuild_reserved(Job& job);
  // Warning about a job's chains; empty: none.
  static std::string chain_message(const JobRow& row);
  UnitState* straggler(Job& job, const WorkerState& worker, Now now);
  UnitState& add_unit(Job& job, const Unit& unit);
  Lease& grant(Job& job, UnitState& unit, WorkerState& worker, bool speculative, Now now);
  double seconds_per_iteration(const Job& job, const WorkerState& worker) const;
  void drop_lease(std::uint64_t token, Now now, bool refund);
  // The same for a unit that its worker may go on computing until it hears of it.
  void take_away(std::uint64_t token, Now now, bool refund);
  // Adds to elapsed_seconds what has passed, if units of the job were under way.
  static void charge(Job& job, Now now);
  // The worker's oldest lease begins or ends to be under way.
  void set_under_way(const WorkerState& worker, bool begins, Now now);

  // scheduler_audits.cpp
  bool chosen_for_audit(const Job& job, const Unit& unit, const WorkerState& worker) const;
  bool could_render(const Job& job, const WorkerState& worker, Now now) const;
  std::set<std::string> jury(const Job& job, Now now) const;  // identities that could render units of the job
  bool may_answer(const Job& job, const UnitState& unit, const WorkerState& worker, Now now) const;
  // Held units go before all others, whatever the priority of their jobs.
  bool lease_held(Job& job, WorkerState& worker, const FilmInputs* films, AcquireResult& out, Now now);
  void settle(Job& job, UnitState& unit, WorkerState& worker, const Delivered& delivered, Now now);
  Reception vote(Job& job, UnitState& unit, WorkerState& worker, const Delivered& delivered, Now now);
  bool decide(Job& job, UnitState& unit, Now now);
  void conclude(Job& job, UnitState& unit, Now now);
  // `by`: those who brought what is merged.
  void add_recheck(Job& job, const Unit& unit, std::string merged_sha256, const std::vector<std::string>& by,
                   std::optional<UnitRow> row, Now now);
  void add_pilot_recheck(Job& job, Now now);  // if the pilot needs one
  static void clear_units(Job& job);
  void want_anew(Job& job, const std::string& why, Now now);
  void tick_audits(Now now);
  void tick_audit(Job& job, UnitState& unit, const std::set<std::string>& able, Now now);
  // The unit is merged after an audit.
  void note_compared(const Audit& audit);
  // scheduler_trust.cpp
  bool distrusts_any(const std::vector<std::string>& identities) const;
  void convict(const std::string& who, const std::string& reason, Now now);
  void forget_answers(const std::string& who);
  // By identity: all that this master has heard of, those that have left included.
  std::set<std::string> known_workers(const std::vector<MakerRow>& makers) const;
  static void doubt_again(Job& job);
  // A job that has not ended, and whose units are not known to be free of doubt.
  void look_for_doubts(Job& job, Now now);
  // The stop rule that holds; empty: none does.
  static std::string stop_due(const Job& job);
  // scheduler_level.cpp
  // The time of the job is up. Whether it goes on for a moment, so that its halves end level.
  bool levels_halves(Job& job, Now now);
  double level_seconds(const Job& job, std::uint64_t missing) const;  // that rendering so much more takes
  // Drops units that have other indices than those the job asks for.
  void drop_unwanted_units(Job& job, Now now);
  static std::string level_text(const Job& job);
  void note_cost(Job& job, const WorkerState& worker, const Unit& unit, double render_seconds);

  // scheduler_progress.cpp
  // Notes in the job that this build has worked on it.
  void note_build(Job& job, Now now);
  void note_steps(Lease& lease, const UnitReport& report, Now now);
  void give_up_stuck(Now now);
  void give_up_stuck(std::uint64_t token, Now now);
  bool end_if_stuck(Job& job, WorkPhase phase, Now now);
  // Cuts units of lower priority where a job waits that no idle worker serves.
  void ask_cuts(Now now);
  // Cuts leases of jobs below this priority. False: all are cut already.
  bool cut_leases(const WorkerState& worker, std::int64_t below_priority);
  // The highest priority among the jobs of the worker's leases; the lowest number if it has none.
  std::int64_t highest_priority(const WorkerState& worker);
  void tell_losses(Now now);
  double useful_threads(const Job& job, double threads_per_worker) const;
  void drop_all_leases(Job& job, Now now);
  // Agrees the job with its film: `rows` that the film lacks are open again (lost, where the job has ended),
  // what the film has and no row tells of becomes rows. Returns how many merged rows the film lacked.
  std::uint64_t agree(Job& job, const HalfSets& film, std::vector<UnitRow> rows, Now now);
  void note_lost(Job& job, const std::string& trouble, Now now);
  // Queues an ended or finishing job again.
  void reopen(Job& job, Now now);
  // If the pilot of an open job kept nothing of what it decided, the job waits for another one.
  void renew_pilot(Job& job);
  static std::string lost_text(const Job& job);
  Result<void> check_starts(const Job& job) const;
  void check_stop(Job& job, Now now);
  // scheduler_prefixes.cpp
  static bool looks_at_prefixes(const Job& job);
  // Finds the next prefix to be looked at from what is merged, and from units if they were cut without one.
  void place_prefix(Job& job, bool with_units = false);
  void drop_off_step(Job& job);
  void drop_ahead(Job& job, const PrefixBorder& border, Now now);
  // The unit was on its way into the film when the job ended at a prefix before it.
  static bool is_dropped(const Job& job, const Unit& unit);
  void stop(Job& job, const std::string& reason, Now now);
  void end(Job& job, JobState state, Now now);
  void start_fairly(Job& job);
  // scheduler_groups.cpp
  void join_group(Job& job);
  void leave_group(Job& job);
  // Outcome of a job or of all jobs of a group: nothing before the end; then the reason why a job that
  // depends on it fails, empty if that job may start.
  std::optional<std::string> outcome(const std::string& id) const;
  void wait_for(const Job& job);  // for what it depends on
  void tell_dependents(const Job& ended);
  void look_at_dependencies(Now now);
  std::string dependency_text(const Job& job) const;
  void save(Job& job, Now now);
  void save(const UnitState& unit);
  void expire(Now now);
  bool make_room_for_worker(Now now);
  // Counts, and sets the worker aside where that is due.
  void note_failure(Job& job, WorkerState& worker, FailureCause cause, const std::string& message,
                    const Consequence& then, Now now);
  bool lives(const WorkerState& worker, Now now) const;
  // Distinct workers that live and could run the job, those set aside included if `all`.
  std::set<std::string> able_workers(const Job& job, bool all, Now now) const;
  // True if the unit is for others to try: this worker failed at it, and one that did not could have it.
  bool barred(const Job& job, const UnitState& unit, const WorkerState& worker, Now now) const;
  bool offered(const Job& job, const UnitState& unit, const WorkerState& worker, Now now) const {
    return unit.leases.empty() && !unit.waits(now.seconds) && !barred(job, unit, worker, now) &&
           may_answer(job, unit, worker, now);
  }
  // The worker has brought something of the job to its end.
  void note_success(Job& job, WorkerState& worker, Now now);
  UnitTrouble& blame(UnitState& unit, FailureCause cause, const WorkerState* worker,
                     const std::string& message);
  void note_lacking(Job& job, UnitState& unit, const std::string& message, Now now);
  bool end_if_poison(Job& job, const UnitState& unit, Now now);
  bool end_if_refused(Job& job, Now now);
  void lost_with_worker(const Lease& lease, Now now);
  void tell_waiting(Job& job, Now now);
  // Tries failed units again now, also on workers set aside for them. False: nothing had failed.
  bool forget_failures(Job& job, Now now);
  Result<void> resume_failed(Job& job, Now now);
  // Earliest retry of the unit, in seconds on the steady clock.
  double next_try(const Job& job, const UnitState& unit, Now now) const;
  Job* find(const std::string& id);
  // The job needs memory from now on, and has it at once where there is no limit.
  void ask_for_memory(Job& job, std::size_t record_bytes);
  // Gives memory to jobs that wait for it.
  void admit_jobs(Now now);
  void admit_if_due(Now now);
  void wait_for_memory(Job& job, const std::string& text, Now now);

  SchedulerOptions options_;
  bool admission_due_ = false;    // a job came, left or changed since admit_jobs()
  bool short_of_memory_ = false;  // some job waits for memory
  double admission_tried_ = 0;
  std::uint64_t next_token_;
  std::uint64_t next_unit_id_;
  std::map<std::string, GroupState> groups_;  // before jobs_, which point into it
  std::map<std::string, Job> jobs_;
  std::map<std::string, std::set<std::string>> dependents_;  // by what they wait for; some may wait no more
  std::set<std::string> dependencies_due_;                   // jobs whose dependencies are to be looked at
  struct Withdrawn {
    std::map<std::string, Job>::node_type node;
    double seconds = 0;
  };
  std::map<std::string, Withdrawn> withdrawn_;
  std::map<std::string, WorkerState> workers_;
  std::set<std::string> paused_;                   // identities of workers, those that are away included
  std::map<std::string, DistrustRow> distrusted_;  // by identity, likewise
  std::set<std::string> to_taint_;                 // workers whose units are to be looked for in ended jobs
  std::set<std::string> jobs_to_taint_;            // that have ended since
  AuditCounts audit_counts_;
  struct ActiveCount {
    std::uint64_t workers = 0;
    double counted = 0;
  };
  std::map<std::string, ActiveCount> active_;  // by instruction set; empty after a worker changed
  std::map<std::uint64_t, Lease> leases_;
  double workers_ticked_ = 0;       // when tick() last looked at the workers
  double none_expires_before_ = 0;  // no lease runs out up to this time, by the steady clock
  std::vector<Change> changes_;
  double last_activity_ = 0;
  std::uint64_t expired_count_ = 0;
  FailureCounts failures_{};
};

}  // namespace candela::master
