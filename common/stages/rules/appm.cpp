// The rule of APPM: the plug-in bandwidth of all sums so far. Each term of a sum is divided by its own kernel
// when it is added, so sums of all radii count [Kaplanyan 2017, section 5.3]. With the constant `pilot_c10` a
// second plane of the state has the levels of the pilots.
#include <cmath>

#include "common/adaptive/channels.h"
#include "common/adaptive/plug_in.h"
#include "common/stages/rules/level_state.h"
#include "common/stages/rules/radius_rules.h"

namespace candela::rules {
namespace {

struct AppmConstants {
  adaptive::Levels levels;
  double c6 = 0, r_min = 0, r_max = 0;
  adaptive::PlugInMedia media;
  double pilot_c10 = 0;  // 0: pilots are no part of the state
  std::vector<std::string> accumulators;
  std::size_t planes() const { return pilot_c10 > 0 ? 2 : 1; }
};

Result<AppmConstants> read_constants(const SettingsMap& constants) {
  AppmConstants read;
  CANDELA_ASSIGN(read.levels, adaptive::get_levels(constants));
  CANDELA_ASSIGN(read.c6, adaptive::get_number(constants, "c6"));
  CANDELA_ASSIGN(read.r_min, adaptive::get_number(constants, "r_min"));
  CANDELA_ASSIGN(read.r_max, adaptive::get_number(constants, "r_max"));
  if (constants.contains("c7")) {
    CANDELA_ASSIGN(read.media.c7, adaptive::get_number(constants, "c7"));
    CANDELA_ASSIGN(read.media.k2_ratio, adaptive::get_number(constants, "k2_ratio"));
  }
  if (!(read.c6 > 0) || !(read.r_min > 0) || !(read.r_max >= read.r_min) || !(read.media.c7 >= 0))
    return failed_error("the constants of the plug-in bandwidth are out of range");
  read.accumulators = {adaptive::kMoments, adaptive::kLaplacian};
  if (constants.contains("pilot_c10")) {
    CANDELA_ASSIGN(read.pilot_c10, adaptive::get_number(constants, "pilot_c10"));
    if (!(read.pilot_c10 > 0)) return failed_error("the constant of the pilot is not above 0");
    read.accumulators.emplace_back(adaptive::kMeans);
  }
  return read;
}

}  // namespace

Result<std::string> decide_appm(const DecisionInput& input, Carry& carry) {
  CANDELA_ASSIGN(const AppmConstants constants, read_constants(input.plan.constants));
  CANDELA_TRY(check_input(input, carry, constants.accumulators, 0, constants.planes()));
  const std::size_t pixels = pixels_of(input);
  if (input.epoch == 0) return std::string(constants.planes() * pixels, '\0');
  std::string state(input.previous);
  if (!input.folded) return state;

  for (std::size_t i = 0; i < carry.sums.size(); ++i)
    CANDELA_TRY(carry.sums[i].merge(*input.folded->sums[i]));
  // Surfaces, and media if they merge.
  const std::size_t channels = constants.media.c7 > 0 ? 2 : 1;
  if (carry.sums[0].spec().channels != channels || carry.sums[1].spec().channels != channels)
    return failed_error("the accumulators of the plug-in bandwidth have another form");
  const adaptive::PlugIn plug_in(constants.levels, constants.c6, constants.r_min, constants.r_max,
                                 constants.media);
  const adaptive::ReferencePilot pilot(constants.pilot_c10);
  // The iterations that the sums have.
  const std::uint64_t iterations = first_iteration(input.plan, input.folded->epoch + 1);
  const int deepest = constants.levels.deepest(first_iteration(input.plan, input.epoch));
  const auto real = [&](std::size_t i, std::uint32_t x, std::uint32_t y, std::uint32_t channel) {
    const film::MergedAccumulator& sums = carry.sums[i];
    return static_cast<double>(sums.sum(x, y, channel)) * std::ldexp(1.0, -sums.spec().scale_log2);
  };
  std::size_t pixel = 0;
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x, ++pixel) {
      const double a2 = real(0, x, y, 0), d1 = real(1, x, y, 0);
      const int present = level_at(state, pixel);
      const int level = channels == 2
                            ? plug_in.level(a2, d1, real(0, x, y, 1), real(1, x, y, 1), iterations, present)
                            : plug_in.level(a2, d1, iterations, present);
      state[pixel] = static_cast<char>(std::min(level, deepest));
      if (constants.pilot_c10 > 0)
        state[pixels + pixel] =
            static_cast<char>(pilot.level(real(2, x, y, 0), a2, d1, level_at(state, pixels + pixel)));
    }
  return state;
}

Result<StateReport> describe_appm(const EpochPlan& plan, std::uint64_t /*epoch*/, std::uint32_t width,
                                  std::uint32_t height, std::string_view state, const Carry& /*carry*/,
                                  bool with_layers) {
  return describe_levels(plan, state.substr(0, std::size_t{width} * height), {}, with_layers);
}

}  // namespace candela::rules
