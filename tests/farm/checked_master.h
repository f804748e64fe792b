// A master of the tests: the product's, with the scheduler's invariants looked at after its calls. A
// violation is a line of its log, which `Farm` and the swarm look for.
#pragma once

#include <cstdio>
#include <cstdlib>

#include "master/program/run_master.h"
#include "master/scheduler/scheduler.h"
#include "tests/farm/process.h"
#include "tests/invariant_watch.h"

namespace candela::farm {

// With $CANDELA_PLANT_VIOLATION set, the first lease is taken from its worker behind the scheduler's back.
inline int run_checked_master(int argc, char** argv) {
  test::InvariantWatch watch(
      [](const std::string& violation) { std::fprintf(stderr, "%s%s\n", kViolation, violation.c_str()); });
  bool planted = std::getenv("CANDELA_PLANT_VIOLATION") == nullptr;
  return master::run_master(argc, argv, [=](const master::Scheduler& scheduler) mutable {
    for (const auto& [id, worker] : scheduler.workers()) {
      if (planted || worker.leases.empty()) continue;
      const_cast<master::WorkerState&>(worker).leases.clear();
      planted = true;
    }
    watch(scheduler);
  });
}

}  // namespace candela::farm
