// The consequence of a failed unit, as a pure function of its cause and of what failed before.
//
// cause   | the unit waits  | its worker, for this job | its worker, for all | the job fails when
// --------|-----------------|--------------------------|---------------------|-------------------
// scene   | no, goes to     | waits                    | -                   | two workers say so
//         | another worker  |                          |                     |
// worker  | yes             | waits                    | is set aside        | all workers fail
// place   | a little        | waits                    | is set aside        | never
// network | a little        | waits                    | -                   | never
// master  | yes             | waits                    | -                   | never
//
// Each wait doubles with every failure and has a jitter of a quarter, which is a hash of names and counts:
// the scheduler stays a function of what it is told.
#pragma once

#include <cstdint>
#include <string_view>

#include "common/job/failure.h"

namespace candela::master {

struct FailurePolicy {
  double set_aside_seconds = 600;         // at most
  double first_set_aside_seconds = 60;    // doubles with each time in a row
  std::uint32_t max_worker_failures = 5;  // in a row, of the worker's own causes
  std::uint32_t max_worker_jobs = 3;      // jobs that it failed at in a row
  std::uint32_t max_unit_failures =
      6;  // of cause worker; the waits between them spread them over 20 s or more
};

// Causes that lie with the worker and are good for nothing else: they count towards its being set aside.
constexpr bool is_workers_own(FailureCause cause) {
  return cause == FailureCause::worker || cause == FailureCause::place;
}

// Failures so far, the present one included.
struct FailureHistory {
  FailureCause cause = FailureCause::worker;
  std::uint64_t unit_id = 0;
  std::string_view worker_id;
  std::uint32_t of_unit = 1;          // of this unit, by this cause
  std::uint32_t at_job = 1;           // of this worker at this job, in a row
  std::uint32_t own = 0;              // of this worker by causes of its own, in a row, at any job
  std::uint32_t own_jobs = 0;         // at so many jobs
  std::uint32_t times_set_aside = 0;  // in a row
};
struct Consequence {
  double unit_wait = 0;    // seconds before anybody is offered the unit
  double worker_wait = 0;  // seconds before this worker is offered anything of the job
  double set_aside = 0;    // seconds before this worker is offered anything at all
};
Consequence consequence(const FailureHistory& history, const FailurePolicy& policy);

// Failures of a unit by cause worker. Workers of one name on one host count as one: a worker that was
// started again is not another witness.
struct Evidence {
  double failures = 0;      // a lease lost with a silent worker counts half: it may have been preempted
  std::size_t workers = 0;  // distinct ones that failed
  std::size_t able = 0;     // distinct ones that live and could run it
};
// It fails, or ends its worker, wherever it is tried.
bool is_poison(const Evidence& unit, const FailurePolicy& policy);

// `said`: distinct workers that named the scene as the cause; `others`: those that live, could run it, and
// have not.
constexpr bool is_refused(std::size_t said, std::size_t others) {
  return said >= 2 || (said == 1 && others == 0);
}

}  // namespace candela::master
