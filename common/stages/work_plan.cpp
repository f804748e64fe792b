#include "common/stages/work_plan.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/chains/chains.h"
#include "common/film/layers.h"
#include "common/job/aov.h"
#include "common/stages/light_visibility.h"

namespace candela {
namespace {

constexpr std::uint32_t kMaxGrowth = 1U << 16;
constexpr std::uint32_t kMaxLag = 64;

Error plan_error(std::string_view field, std::string message) {
  return input_error(std::move(message)).with_field(fmt::format("work.{}", field));
}

Result<void> validate_constants(std::string_view field, const SettingsMap& constants) {
  if (constants.size() > Limits::max_settings)
    return plan_error(field, fmt::format("more than {}", Limits::max_settings));
  for (const auto& [name, value] : constants)
    if (name.empty() || name.size() > Limits::max_name_bytes || value.size() > Limits::max_setting_bytes)
      return plan_error(field, fmt::format("'{}' has no name, or is too long", name));
  return {};
}

Result<void> validate(const EpochPlan& plan) {
  const auto bad = [](std::string_view field, std::string message) {
    return plan_error(fmt::format("epochs.{}", field), std::move(message));
  };
  if (plan.first == 0 || plan.first % 2 != 0 || plan.first > Limits::max_iterations)
    return bad("first",
               fmt::format("{} iterations cannot be the first epoch: an even number is needed", plan.first));
  if (plan.growth == 0 || plan.growth > kMaxGrowth)
    return bad("growth", fmt::format("{} is not 1 to {}", plan.growth, kMaxGrowth));
  if (plan.lag > kMaxLag) return bad("lag", fmt::format("{} epochs, at most {}", plan.lag, kMaxLag));
  if (plan.rule.empty() || plan.rule.size() > Limits::max_name_bytes)
    return bad("rule", "it has no name, or too long a one");
  return validate_constants("epochs.constants", plan.constants);
}

Result<void> validate(const DevelopmentPlan& plan) {
  if (plan.name.empty() || plan.name.size() > Limits::max_name_bytes)
    return plan_error("development.name", "it has no name, or too long a one");
  return validate_constants("development.constants", plan.constants);
}

}  // namespace

Result<void> validate(const WorkPlan& plan, std::uint32_t width, std::uint32_t height) {
  if (auto layout = film::make_layout(width, height, plan.layers); !layout.ok())
    return plan_error("layers", layout.error().message);
  if (auto valid = film::validate(plan.accumulators, width, height); !valid.ok())
    return plan_error("accumulators", valid.error().message);
  // Who reads an accumulator asks for it by its name, and knows its domain.
  for (const film::AccumulatorSpec& spec : plan.accumulators) {
    using Domain = film::AccumulatorSpec::Domain;
    const bool known = spec.name == light_visibility::kCounts ? spec.domain != Domain::keys
                       : spec.name.starts_with(kAovPrefix)    ? spec.domain != Domain::table
                                                              : spec.domain == Domain::film;
    if (!known)
      return plan_error("accumulators",
                        fmt::format("'{}' is kept in another domain than its readers know", spec.name));
  }
  if (plan.chains) {
    if (auto valid = chains::validate(*plan.chains); !valid.ok())
      return plan_error(fmt::format("chains.{}", valid.error().field), valid.error().message);
    if (plan.layers.size() + 1 < chains::kImageLayers)
      return plan_error("layers", "a job of chains has a second layer, which is part of the image");
    if (plan.epochs) return plan_error("epochs", "a job of chains has none");
    if (plan.development) return plan_error("development", "a job of chains has its own");
  }
  if (plan.development) CANDELA_TRY(validate(*plan.development));
  if (plan.epochs) return validate(*plan.epochs);
  const bool per_epoch =
      std::any_of(plan.accumulators.begin(), plan.accumulators.end(),
                  [](const auto& spec) { return spec.per == film::AccumulatorSpec::Per::epoch; });
  if (per_epoch) return plan_error("accumulators", "one is kept for each epoch, and there are no epochs");
  return {};
}

}  // namespace candela
