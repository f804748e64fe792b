#include "common/stages/rules/level_state.h"

#include <fmt/format.h>

#include <array>

namespace candela::rules {

Result<void> check_input(const DecisionInput& input, Carry& carry, const std::vector<std::string>& names,
                         std::size_t memo_planes, std::size_t state_planes) {
  const std::size_t pixels = pixels_of(input);
  const auto has_names = [&](const auto& sums, const auto& spec_of) {
    return sums.size() == names.size() &&
           std::equal(sums.begin(), sums.end(), names.begin(), [&](const auto& sum, const std::string& name) {
             const film::AccumulatorSpec& spec = spec_of(sum);
             return spec.name == name && spec.domain == film::AccumulatorSpec::Domain::film;
           });
  };
  if (!has_names(
          carry.sums, [](const auto& sum) -> const auto& { return sum.spec(); }))
    return failed_error(
        fmt::format("the rule '{}' needs accumulators that are not the job's", input.plan.rule));
  if (input.epoch == 0) carry.memo.assign(memo_planes * pixels, '\0');
  if (carry.memo.size() != memo_planes * pixels)
    return failed_error(fmt::format("the rule '{}' carries a memo of another film", input.plan.rule));
  if (input.epoch != 0 && input.previous.size() != state_planes * pixels)
    return failed_error("the state before is of another film");
  if (!input.folded) return {};
  if (!has_names(
          input.folded->sums, [](const auto* sum) -> const auto& { return sum->spec(); }) ||
      input.folded->state.size() != state_planes * pixels)
    return failed_error("the epoch to fold is of another film");
  return {};
}

std::uint64_t first_iteration(const EpochPlan& plan, std::uint64_t epoch) {
  return Epochs(plan.first, plan.growth).begin(epoch);
}

Result<StateReport> describe_levels(const EpochPlan& plan, std::string_view state,
                                    const std::vector<Plane>& planes, bool with_layers) {
  CANDELA_ASSIGN(const adaptive::Levels levels, adaptive::get_levels(plan.constants));
  std::vector<double> radii = levels.radii(1);
  radii.resize(adaptive::kMaxLevel + 1, radii.back());
  for (const Plane& plane : planes)
    if (plane.bytes.size() != state.size()) return failed_error("the state is of another film than its memo");
  std::array<std::uint64_t, adaptive::kMaxLevel + 1> counts{};
  for (std::size_t i = 0; i < state.size(); ++i) ++counts[static_cast<std::size_t>(level_at(state, i))];

  const auto pixels = static_cast<double>(std::max<std::size_t>(state.size(), 1));
  double sum = 0, median = radii[0];
  std::uint64_t below = 0;
  for (std::size_t g = 0; g < counts.size(); ++g) {
    sum += static_cast<double>(counts[g]) * radii[g];
    if (2 * below <= state.size() && counts[g] != 0) median = radii[g];
    below += counts[g];
  }
  StateReport report;
  const auto shrunk = static_cast<double>(state.size() - counts[0]);
  report.figures = {{"pixels shrunk", shrunk},
                    {"share of pixels shrunk", shrunk / pixels},
                    {"median radius", median},
                    {"mean radius", sum / pixels}};
  for (const Plane& plane : planes) {
    std::uint64_t total = 0;
    for (std::size_t i = 0; i < plane.bytes.size(); ++i)
      total += static_cast<std::uint64_t>(level_at(plane.bytes, i));
    report.figures.emplace_back(plane.figure, static_cast<double>(total));
  }
  if (!with_layers) return report;
  report.layers.push_back({"radius", {}});
  for (std::size_t i = 0; i < state.size(); ++i)
    report.layers[0].values.push_back(
        static_cast<float>(radii[static_cast<std::size_t>(level_at(state, i))]));
  for (const Plane& plane : planes) {
    StateReport::Layer layer{plane.layer, {}};
    for (std::size_t i = 0; i < plane.bytes.size(); ++i)
      layer.values.push_back(static_cast<float>(level_at(plane.bytes, i)));
    report.layers.push_back(std::move(layer));
  }
  return report;
}

}  // namespace candela::rules
