// Named invariants of the scheduler: what holds between any two calls of it, whatever happened before. Tests
// call check_invariants().
#pragma once

#include <string>
#include <vector>

namespace candela::master {

class Scheduler;

// A line for each violation: the invariant's name, ": ", and the ids concerned. Empty if all hold. The time
// taken grows with jobs, units that are not merged, leases and workers.
//
//   lease-key       a lease lies under its token, which was given out before
//   lease-job       its job is there, and goes on
//   lease-unit      its unit is there, and names the lease once
//   lease-worker    its worker is there, and names the lease
//   lease-expiry    it does not run out before the time up to which none does
//   worker-key      a worker lies under its id
//   worker-lease    each lease that a worker names is a lease of this worker; there are no more than allowed
//   unit-key        a unit lies under its id, which was given out before, and is of its job
//   unit-lease      each lease that a unit names is a lease of this unit; there are at most two, of two
//                   workers; a second one is a straggler's
//   unit-state      a unit is leased if and only if it has a lease, and none that is kept is merged
//   unit-offered    a unit without a lease is among those that are offered
//   unit-unmerged   no index is both merged and in a unit
//   unit-once       no index is in two units
//   unit-kind       a unit is of the stage that its job is in
//   all-indices     merged, in units, and to be cut: each index that the job asks for is exactly one of them
//   merged-count    the job's count of indices is the size of the merged set
//   job-key         a job lies under its id, and has the stage that its row tells
//   job-ended       a job that ends or has ended has no unit; one that has ended neither ends nor is repaired
//   job-states      its decided states are those of epochs 0, 1, ..., and as they were first decided
//   job-starts      a job of chains in its film's stage has a start for each chain, or none at all
//   audit           a held unit is among those of its job, and is of no recheck; a recheck is counted; each
//   worker
//                   has one answer, and none that is distrusted has one
//   audit-merged    a unit that is looked at again is merged, or the pilot
//   distrusted      a worker that is distrusted is told so, and has no lease
//   doubtful        a job that ends has nothing to be looked at again
//   withdrawn       a job that is being removed has ended, and is not in the list
std::vector<std::string> check_invariants(const Scheduler& scheduler);

}  // namespace candela::master
