// Developments: the image of a job whose read-out is more than a mean, by a rule with a name. A rule reads
// merged sums alone and gives corrections to the film's; it runs when somebody asks for an image.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/accumulator.h"
#include "common/film/development.h"
#include "common/stages/work_plan.h"

namespace candela {

struct DevelopmentInput {
  const DevelopmentPlan& plan;
  std::string_view estimator;  // one that the rule offers
  std::uint32_t width = 0, height = 0;
  // The sums of an accumulator over a half of the job, all of one moment and that of the film. Null: nothing
  // is merged, or the job has none of this name for each half.
  std::function<const film::MergedAccumulator*(std::string_view name, std::uint32_t half)> sums;
};

// By half, as film::Development has them; empty: none.
using Corrections = std::array<std::vector<float>, 2>;

struct DevelopmentRule {
  std::string_view name;
  std::span<const std::string_view> estimators;
  // Fails (input) on constants or accumulators that the rule cannot read.
  Result<void> (*validate)(const WorkPlan& plan);
  // Precondition: the plan is valid.
  Corrections (*correct)(const DevelopmentInput& input);
};

// A program's rules. The library candela_rules defines this function alone (developments/developments.cpp); a
// test program that defines it among its own objects has rules of its own.
std::span<const DevelopmentRule> developments();

// Fails (input) unless the plan has no development, or one of a known rule that it fits, with an estimator of
// that rule.
Result<void> check_development(const WorkPlan& plan);

// The estimator that is the image unless another is asked for. Precondition: check_development().
std::string_view default_estimator(const DevelopmentPlan& plan);

// Corrections of the film by `input`'s estimator; empty: the plan's. An estimator that the rule does not
// offer is a usage error that lists those it does.
Result<Corrections> correct(DevelopmentInput input);

}  // namespace candela
