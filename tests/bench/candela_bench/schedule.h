// Runs many estimators beside each other, each in its turn for a slice, and records points.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/candela_bench/estimator.h"
#include "tests/bench/candela_bench/figures.h"
#include "tests/bench/candela_bench/spec.h"
#include "tests/bench/candela_bench/store.h"

namespace candela::bench {

// The points of equal-iteration runs: 1, 2, 4, ... and `last`, with `per_doubling` of them a doubling.
std::vector<std::uint64_t> iteration_points(std::uint64_t last, int per_doubling);
// Points of equal-time runs, seconds: first, 2 first, 4 first ... and `last`. A point is recorded at the end
// of the first unit that ends at or after it.
std::vector<double> time_points(double first, double last, int per_doubling);

struct Schedule {
  Budget budget;
  double reference_factor =
      kReferenceFactor;    // a row whose reference is not this many times better is "noisy"
  std::size_t beside = 0;  // 0: all at once
  bool flip = true;
  Machine machine;
  const std::atomic<bool>* stop = nullptr;
  std::function<void(const std::string&)> say = nullptr;  // progress, a line each
};

struct RunResult {
  RunSpec run;
  std::vector<Row> rows;
  std::optional<Error> error;
};

using ReferenceSource = std::function<Result<std::shared_ptr<const Reference>>(const std::string& path)>;

// All runs, round-robin. Those that `store` (null: nothing is kept) has go on where they were; finished ones
// are not even started. A run that fails has an error, and the others go on.
std::vector<RunResult> run_all(const std::vector<RunSpec>& runs, const Schedule& schedule,
                               const EstimatorFactory& factory, const ReferenceSource& references,
                               const Store* store);

}  // namespace candela::bench
