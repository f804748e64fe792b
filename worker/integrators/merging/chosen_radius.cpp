#include "worker/integrators/merging/chosen_radius.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "worker/integrators/decision_bytes.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/neighbor_radius.h"
#include "worker/scene/scene.h"

namespace candela::integrators::merging {
namespace {

// Light paths of the pilot: those of an iteration, within these.
constexpr double kFewestPaths = 1 << 11, kMaxPaths = 1 << 14;
constexpr int kGrid = 16;  // by as many eye paths

constexpr std::string_view kKind = "rad1";  // of the decision

ChosenRadius automatic_radius(const UnitContext& context, const MergeRules& rules,
                              const estimators::PathOptions& options,
                              const estimators::Techniques& techniques) {
  const auto paths = static_cast<double>(light_path_count(rules, context));
  const double pilot_paths = std::clamp(std::floor(paths), kFewestPaths, kMaxPaths);
  // If the pilot has more light paths than an iteration, more of its photons are within the radius.
  const double neighbors = std::min(kAutomaticPhotons * std::max(1.0, pilot_paths / paths), pilot_paths / 4);
  const NeighborPilot pilot{static_cast<std::uint64_t>(pilot_paths), kGrid,
                            techniques.merge_medium && !rules.separate_media};
  const double found = options.max_depth < 2 ? 0
                                             : neighbor_radius(context, options, static_cast<int>(neighbors),
                                                               std::max(paths, pilot_paths), pilot);
  const double fraction = first_radius(context, kFallbackFraction, 0);
  if (found <= 0) return {fraction, "a pilot found too few photons to choose by"};
  const double pixels = most_pixels(rules, techniques),
               most = std::max(pixels * pixel_footprint(context), fraction);
  if (found > most)
    return {clamped_radius(most), fmt::format("at most {} pixels or {} of the bounding sphere: fewer than {} "
                                              "photons of an iteration lie within it, in the median",
                                              pixels, kFallbackFraction, kAutomaticPhotons)};
  return {clamped_radius(found),
          fmt::format("{} photons of an iteration lie within it, in the median", kAutomaticPhotons)};
}

ChosenRadius given_radius(const UnitContext& context, const MergeRules& rules,
                          const estimators::PathOptions& options) {
  std::string too_few;
  if (rules.radius_neighbors > 0) {
    const double found = options.max_depth < 2
                             ? 0
                             : neighbor_radius(context, options, rules.radius_neighbors,
                                               static_cast<double>(light_path_count(rules, context)));
    if (found > 0) return {clamped_radius(found), fmt::format("radius_neighbors={}", rules.radius_neighbors)};
    too_few = ", as a pilot found too few photons for radius_neighbors";
  }
  const double fraction = rules.radius > 0 ? rules.radius : kFallbackFraction;
  return {first_radius(context, fraction, rules.radius_pixels),
          (rules.radius_pixels > 0 ? fmt::format("radius_pixels={}", rules.radius_pixels)
                                   : fmt::format("radius={}", fraction)) +
              too_few};
}

}  // namespace

std::uint64_t light_path_count(const MergeRules& rules, const UnitContext& context) {
  const double pixels = static_cast<double>(context.width) * context.height;
  return static_cast<std::uint64_t>(std::max(1.0, std::floor(rules.light_paths * pixels + 0.5)));
}

ChosenRadius choose_radius(const UnitContext& context, const MergeRules& rules,
                           const estimators::PathOptions& paths, const estimators::Techniques& techniques) {
  return rules.is_automatic() ? automatic_radius(context, rules, paths, techniques)
                              : given_radius(context, rules, paths);
}

double most_pixels(const MergeRules& rules, const estimators::Techniques& techniques) {
  if (techniques.next_event || techniques.connect) return rules.adapts ? 1 : 0.5;
  return techniques.merge_medium ? 10 : 2;
}

void note_radius(const ChosenRadius& chosen, const UnitContext& context, Plan& plan) {
  const auto sphere = static_cast<double>(context.scene.features().radius);
  std::string share;
  if (sphere > 0) share = fmt::format(", {:.3g} of the scene's bounding sphere", chosen.value / sphere);
  plan.note("first merging radius", fmt::format("{:.4g}{}: {}", chosen.value, share, chosen.why));
}

Decision decide_radius(Plan plan, const UnitContext& context, const IterationOptions& options) {
  if (!options.techniques.merges()) return {{}, std::move(plan)};
  const ChosenRadius chosen = choose_radius(context, options.merge, options.paths, options.techniques);
  note_radius(chosen, context, plan);
  return {radius_bytes(chosen.value), std::move(plan)};
}

std::string radius_bytes(double radius) {
  DecisionWriter out(kKind);
  out.real(radius);
  return out.bytes();
}

Result<double> decided_radius(const UnitInput& input, const IterationOptions& options) {
  if (!options.techniques.merges()) return 1.0;
  DecisionReader in(input.state.decided, kKind);
  const double radius = in.real(kMinRadius, kGreatestRadius);
  CANDELA_TRY(in.done());
  return radius;
}

}  // namespace candela::integrators::merging
