// Compares what is told of a job with its files: its film against its ledger, its scene's files against their
// names, its state against its film.
//
// The one place that reads a film from disk while the farm runs. Whoever needs a film (fetch, extend, ledger,
// a lease of chains, a delivery, the upkeep) asks open_film(), which agrees the job with what was read before
// anybody uses it. A start verifies ended jobs one after the other behind the farm's back; `candela verify`
// does so when asked, for any job.
//
// A damaged checkpoint is set aside, with an event. If the film lacks what rows tell of, a job that runs or
// is paused renders it again; a job that has ended says in show, fetch and an event what is lost, and renders
// it when repair or extend ask. If the film has what no row tells of, rows are added. A scene file that is
// missing or damaged is set aside; a job that needs it waits, and the next submission of the scene brings it.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "master/merge/job_film.h"
#include "master/store/records.h"
#include "master/truth/truth_farm.h"

namespace candela::master {

// Findings of the comparison of a job with its files, or of the store with its folders.
struct JobReport {
  struct Finding {
    std::string part;  // "film", "ledger", "scene", "state", "store"
    std::string text;
    std::string mend;  // what to do about it
  };
  std::string job_id, name;       // empty for the store
  std::optional<JobState> state;  // none for the store
  std::uint64_t iterations = 0;   // merged
  std::uint64_t lost = 0;         // sequence indices
  std::vector<Finding> findings;  // none: the job's files bear out what is told of it
};

class JobTruth {
 public:
  explicit JobTruth(TruthFarm& farm) : farm_(farm) {}

  // The job's film, loaded and agreed with its rows; null before the pilot. `use`: it stays in memory for a
  // while. Errors: the place keeps it from being read.
  Result<std::shared_ptr<JobFilm>> open_film(const std::string& job_id, bool use = true);
  // The same for a film that is loaded and turns out not to hold what the scheduler counts as merged: agrees
  // the job with it. False: there is no difference.
  bool agree_if_short(const std::string& job_id, JobFilm& film);

  // Precondition of these: the job exists.
  Result<JobReport> verify(const std::string& job_id);
  // Reports folders that belong to no job of the store.
  JobReport verify_store() const;
  // Queues what an ended job has lost, or takes the job of an unknown folder into the store. False: there is
  // neither a job nor a folder of this id.
  Result<bool> repair(const std::string& job_id);
  // Reads the films of all ended jobs, at a pace that leaves the disk to others. Returns when the farm stops.
  void verify_ended();

  // Folders of films that the store knows no job of.
  std::vector<std::string> orphans() const;
  // Writes the job's manifest where it differs from the one written before. Precondition: the job has a film.
  Result<void> keep_manifest(const std::string& job_id);

 private:
  Result<std::vector<UnitRow>> merged_rows(const std::string& job_id);
  Result<void> adopt(const std::string& job_id);
  void check_scene(const JobRow& row, JobReport& report);
  Result<void> check_ledger(const std::string& job_id, JobFilm& film, JobReport& report);
  void check_states(const std::string& job_id, const JobFilm& film, JobReport& report);
  std::filesystem::path folder(const std::string& job_id) const;

  TruthFarm& farm_;
  std::map<std::string, std::string>
      manifests_;  // job -> hash of what is written; guarded by JobUpkeep's lock
};

}  // namespace candela::master
