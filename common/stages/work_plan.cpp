#include "common/stages/work_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

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

// Readers of these accumulators ask for them by name, and know their domains. Rules and developments check
// the domains of all others themselves.
bool known_domain(const film::AccumulatorSpec& spec) {
  using Domain = film::AccumulatorSpec::Domain;
  if (spec.name == light_visibility::kCounts) return spec.domain != Domain::keys;
  return !spec.name.starts_with(kAovPrefix) || spec.domain != Domain::table;
}

enum class Part : std::uint8_t { second_layer, sums_of_epochs, chains, epochs, development };

bool has(const WorkPlan& plan, Part part) {
  switch (part) {
    case Part::second_layer:
      return plan.layers.size() + 1 >= chains::kImageLayers;
    case Part::sums_of_epochs:
      return std::any_of(plan.accumulators.begin(), plan.accumulators.end(),
                         [](const auto& spec) { return spec.per == film::AccumulatorSpec::Per::epoch; });
    case Part::chains:
      return plan.chains.has_value();
    case Part::epochs:
      return plan.epochs.has_value();
    case Part::development:
      return plan.development.has_value();
  }
  return false;
}

// Pairs of parts of which one needs or excludes the other. All other pairs go together: the state of an epoch
// is frozen for iterations and for segments of chains.
struct Pair {
  Part part;
  enum Rule : std::uint8_t { needs, excludes } rule;
  Part other;
  std::string_view field, message;
};
constexpr std::array<Pair, 3> kPairs{{
    {Part::chains, Pair::needs, Part::second_layer, "layers",
     "a job of chains has a second layer, which is part of the image"},
    {Part::chains, Pair::excludes, Part::development, "development", "a job of chains has its own"},
    {Part::sums_of_epochs, Pair::needs, Part::epochs, "accumulators",
     "one is kept for each epoch, and there are no epochs"},
}};

}  // namespace

Result<void> validate(const WorkPlan& plan, std::uint32_t width, std::uint32_t height) {
  if (auto layout = film::make_layout(width, height, plan.layers); !layout.ok())
    return plan_error("layers", layout.error().message);
  if (auto valid = film::validate(plan.accumulators, width, height); !valid.ok())
    return plan_error("accumulators", valid.error().message);
  for (const film::AccumulatorSpec& spec : plan.accumulators)
    if (!known_domain(spec))
      return plan_error("accumulators",
                        fmt::format("'{}' is kept in another domain than its readers know", spec.name));
  if (plan.chains)
    if (auto valid = chains::validate(*plan.chains); !valid.ok())
      return plan_error(fmt::format("chains.{}", valid.error().field), valid.error().message);
  for (const Pair& pair : kPairs)
    if (has(plan, pair.part) && has(plan, pair.other) != (pair.rule == Pair::needs))
      return plan_error(pair.field, std::string(pair.message));
  if (plan.development) CANDELA_TRY(validate(*plan.development));
  return plan.epochs ? validate(*plan.epochs) : Result<void>();
}

}  // namespace candela
