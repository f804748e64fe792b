// A job's plan of work: all that an integrator asks of the farm, as the pilot answers it. From then on the
// plan is part of the job. It names the sums that every unit brings and the stages they come in.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/film/accumulator.h"
#include "common/film/layout.h"
#include "common/job/job.h"

namespace candela {

// Iterations [T_e, T_{e+1}) of the job are epoch e: T_0 = 0, T_{e+1} - T_e = max(first, T_e / growth),
// rounded up to even. The state of epoch e is decided from the merged sums of all epochs up to e - 1 - lag.
struct EpochPlan {
  std::uint64_t first = 0;  // iterations of epoch 0, even
  std::uint32_t growth = 16;
  std::uint32_t lag = 1;  // epochs
  std::string rule;       // name of the decision rule
  SettingsMap constants;  // of the rule
  bool operator==(const EpochPlan&) const = default;
};

// Read-out of the image from film and accumulators, if it is more than a mean: a rule by name
// (common/stages/development.h) and its constants, among them `estimator`, the read-out that is the image
// unless somebody asks for another.
struct DevelopmentPlan {
  std::string name;
  SettingsMap constants;
  bool operator==(const DevelopmentPlan&) const = default;
};

struct WorkPlan {
  std::vector<std::string> layers = {};  // of the film beside the image, in order; empty for most
  std::vector<film::AccumulatorSpec> accumulators = {};
  std::optional<ChainPlan> chains = {};  // a job of chains: the bootstrap comes after the pilot
  std::optional<EpochPlan> epochs = {};
  std::optional<DevelopmentPlan> development = {};  // absent: the mean
};

// Fails (input) unless every part is valid for a film of this size, the film has the layers that a job of
// chains makes its image of, and accumulators for each epoch come with epochs. The error's field is that of
// the plan.
Result<void> validate(const WorkPlan& plan, std::uint32_t width, std::uint32_t height);

struct PilotResult {
  NamedState state;
  std::string plan;                  // text, for people and metadata
  double seconds_per_iteration = 0;  // with the threads it was measured with; of chains: per segment
  WorkPlan work = {};
};

}  // namespace candela
