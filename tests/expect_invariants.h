// The observer of a master in a test's own process: each violated invariant of the scheduler is a failure.
#pragma once

#include <gtest/gtest.h>

#include "tests/invariant_watch.h"

namespace candela::test {

inline master::SchedulerObserver expect_invariants() {
  return InvariantWatch([](const std::string& violation) { ADD_FAILURE() << violation; });
}

}  // namespace candela::test
