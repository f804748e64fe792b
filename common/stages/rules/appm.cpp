// The rule of APPM: the plug-in bandwidth of all sums so far. Each term of a sum is divided by its own kernel
// when it is added, so sums of all radii count [Kaplanyan 2017, section 5.3].
#include <cmath>

#include "common/adaptive/channels.h"
#include "common/adaptive/plug_in.h"
#include "common/stages/rules/level_state.h"
#include "common/stages/rules/radius_rules.h"

namespace candela::rules {
namespace {

const std::vector<std::string>& accumulators() {
  static const std::vector<std::string> names = {adaptive::kMoments, adaptive::kLaplacian};
  return names;
}

}  // namespace

Result<std::string> decide_appm(const DecisionInput& input, Carry& carry) {
  CANDELA_TRY(check_input(input, carry, accumulators(), 0));
  const SettingsMap& constants = input.plan.constants;
  CANDELA_ASSIGN(const adaptive::Levels levels, adaptive::get_levels(constants));
  CANDELA_ASSIGN(const double c6, adaptive::get_number(constants, "c6"));
  CANDELA_ASSIGN(const double r_min, adaptive::get_number(constants, "r_min"));
  CANDELA_ASSIGN(const double r_max, adaptive::get_number(constants, "r_max"));
  if (!(c6 > 0) || !(r_min > 0) || !(r_max >= r_min))
    return failed_error("the constants of the plug-in bandwidth are out of range");
  if (input.epoch == 0) return std::string(pixels_of(input), '\0');
  std::string state(input.previous);
  if (!input.folded) return state;

  for (std::size_t i = 0; i < carry.sums.size(); ++i)
    CANDELA_TRY(carry.sums[i].merge(*input.folded->sums[i]));
  const adaptive::PlugIn plug_in(levels, c6, r_min, r_max);
  // The iterations that the sums have.
  const std::uint64_t iterations = first_iteration(input.plan, input.folded->epoch + 1);
  const int deepest = levels.deepest(first_iteration(input.plan, input.epoch));
  const double moment = std::ldexp(1.0, -carry.sums[0].spec().scale_log2);
  const double laplacian = std::ldexp(1.0, -carry.sums[1].spec().scale_log2);
  std::size_t pixel = 0;
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x, ++pixel) {
      const double a2 = static_cast<double>(carry.sums[0].sum(x, y, 0)) * moment;
      const double d1 = static_cast<double>(carry.sums[1].sum(x, y, 0)) * laplacian;
      const int level = plug_in.level(a2, d1, iterations, level_at(state, pixel));
      state[pixel] = static_cast<char>(std::min(level, deepest));
    }
  return state;
}

Result<StateReport> describe_appm(const EpochPlan& plan, std::uint64_t /*epoch*/, std::uint32_t /*width*/,
                                  std::uint32_t /*height*/, std::string_view state, const Carry& /*carry*/,
                                  bool with_layers) {
  return describe_levels(plan, state, {}, with_layers);
}

}  // namespace candela::rules
