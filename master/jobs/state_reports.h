// Reports describe the decided states of a job of epochs for people. The master makes a report when somebody
// asks, once for each decision.
//
// `mutex_` guards the reports that are remembered. It is not held while a report is made.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "common/stages/decision.h"
#include "master/jobs/job_status.h"
#include "master/jobs/job_table.h"
#include "master/truth/job_truth.h"

namespace candela::master {

class StateReports {
 public:
  StateReports(JobTable& table, JobTruth& truth) : table_(table), truth_(truth) {}

  // Nothing: the job has no epochs, or no state is decided. Reads the film of a job that has ended if nothing
  // is remembered of it.
  std::optional<EpochStatus> status(const std::string& job_id);
  // The layers of the newest state; none if the rule offers none.
  static Result<std::vector<StateReport::Layer>> layers(const JobFilm& film);

 private:
  JobTable& table_;
  JobTruth& truth_;
  Mutex mutex_;
  struct Told {
    std::uint64_t decisions = 0;
    EpochStatus status;
  };
  std::map<std::string, Told> told_ CANDELA_GUARDED_BY(mutex_);  // by job
};

}  // namespace candela::master
