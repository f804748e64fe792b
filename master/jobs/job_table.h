// The scheduler and the films of its jobs, under one lock.
//
// The lock is never held across I/O or across a merge into a film, which has a lock of its own. Each
// decision's changes are handed to the store's queue before the lock is released, so the store sees them in
// the order of the decisions.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/base/memory_limit.h"
#include "common/base/mutex.h"
#include "master/merge/job_film.h"
#include "master/options.h"
#include "master/scheduler/scheduler.h"
#include "master/store/store.h"

namespace candela::master {

// Sees the changes of a call under the lock, before they go to the store. It must not wait for anything.
using ChangeListener = std::function<void(const Scheduler&, std::span<const Change>)>;

using JobFilms = std::map<std::string, std::shared_ptr<JobFilm>>;  // by job

class JobTable {
 public:
  // `folder` holds one folder for each job. `film_writer` writes checkpoints.
  JobTable(std::unique_ptr<Scheduler> scheduler, StoreWriter& writer, std::filesystem::path folder,
           FileWriter film_writer, SchedulerObserver observer, ChangeListener listener);

  static Now now();

  // Runs `f(scheduler)` under the lock, then hands its changes to the store's queue.
  template <class F>
  auto with_scheduler(F&& f) {
    return with_films([&](Scheduler& scheduler, JobFilms&) { return f(scheduler); });
  }
  // The same for `f(scheduler, films)`.
  template <class F>
  auto with_films(F&& f) {
    struct Finally {
      JobTable& table;
      ~Finally() CANDELA_UNANALYZED { table.publish(); }  // under the lock
    };
    const Lock lock(mutex_);
    const SmallWork small;
    const Finally finally{*this};
    return f(*scheduler_, films_);
  }

  // Returns when `holds(scheduler)`, which is asked now and after each change, or after so many seconds.
  void wait_for(double seconds, const std::function<bool(const Scheduler&)>& holds);

  // Loaded or not (JobTruth::open_film loads it); null before the pilot and for unknown jobs.
  std::shared_ptr<JobFilm> film_of(const std::string& job_id);
  JobFilms films() const;
  // A film without content that is not in the table. Precondition: the pilot is done.
  std::shared_ptr<JobFilm> make_film(const JobRow& row) const;
  // Tells the film every decided state of its job, for the next checkpoint. A film whose checkpoint was lost
  // has fewer than the store.
  void remember_states(const std::string& job_id, JobFilm& film);
  std::filesystem::path folder_of(const std::string& job_id) const { return folder_ / job_id; }

 private:
  // If memory runs out the next call hands the changes over.
  void publish() noexcept CANDELA_REQUIRES(mutex_);

  StoreWriter& writer_;
  const std::filesystem::path folder_;
  const FileWriter film_writer_;
  const SchedulerObserver observer_;
  const ChangeListener listener_;

  std::condition_variable changed_;
  mutable Mutex mutex_;
  std::unique_ptr<Scheduler> scheduler_ CANDELA_GUARDED_BY(mutex_);
  JobFilms films_ CANDELA_GUARDED_BY(mutex_);
  std::vector<Change> unpublished_ CANDELA_GUARDED_BY(mutex_);
};

}  // namespace candela::master
