// Measures an image that gets better with every unit, and what its units cost.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/stats/movement.h"
#include "tests/bench/candela_bench/spec.h"
#include "tests/half_images.h"

namespace candela::bench {

// Costs of all units so far. Seconds are those of the calls that render, nothing else: no loading, merging,
// encoding, comparing.
struct Cost {
  std::uint64_t units = 0;  // iterations, or segments of chains
  double cpu_seconds = 0;   // user and system, all threads of the process
  double wall_seconds = 0;
  double setup_seconds = 0;  // wall: scene compiled, pilot done
  std::uint64_t eye_samples = 0, light_paths = 0, rays = 0, rejected = 0;
  std::uint64_t deltas = 0, delta_bytes = 0;  // one a unit range, as a worker would push it
  std::uint64_t peak_memory_bytes = 0;        // of the process that renders
};

struct Snapshot {
  std::vector<float> image;  // after cost().units: width * height * 3
  double own_relmse = 0;     // estimated from the two halves alone; NaN with fewer than two units
};

class Estimator {
 public:
  virtual ~Estimator() = default;
  virtual std::string unit_name() const = 0;  // "iterations"
  // Renders until `units` are in. The image does not depend on how many calls that took.
  virtual Result<Cost> advance(std::uint64_t units) = 0;
  virtual Result<Snapshot> snapshot() = 0;
  // The plan of the integrator as text; empty from another process.
  virtual std::string plan() const { return {}; }
  // The halves of the image. Refused by an estimator in another process.
  virtual Result<stats::HalfImages> halves() { return refused_error("these halves are not kept"); }
  // The bias of merging as photons measure it; empty: nothing does.
  virtual stats::Movement::Bias measured_bias() const { return {}; }
  // All that going on takes, beside the run's description; restore() only on a fresh one.
  virtual Result<std::string> save() = 0;
  virtual Result<Cost> restore(std::string_view saved) = 0;
};

using EstimatorFactory = std::function<Result<std::unique_ptr<Estimator>>(const RunSpec&)>;

// Under Callgrind: writes what was counted since the last call to a file of its own.
void end_counting();

// Renders in this process.
Result<std::unique_ptr<Estimator>> make_render_estimator(const RunSpec& run);

}  // namespace candela::bench
