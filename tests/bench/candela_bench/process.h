// An estimator in a process of its own: its peak memory is its own, and if it crashes the others go on.
#pragma once

#include "tests/bench/candela_bench/estimator.h"

namespace candela::bench {

// Starts `program serve`, which must call serve(). One call at a time; SIGINT does not reach the process.
Result<std::unique_ptr<Estimator>> make_process_estimator(const std::string& program, const RunSpec& run);

// The other end: answers requests from `in` on `out` until `in` ends. Returns the exit code.
int serve(int in, int out, const EstimatorFactory& factory);

}  // namespace candela::bench
