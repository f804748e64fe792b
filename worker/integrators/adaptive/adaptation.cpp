#include "worker/integrators/adaptive/adaptation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/adaptive/channels.h"
#include "common/adaptive/plug_in.h"
#include "common/adaptive/quantile.h"

namespace candela::integrators::adaptive {

namespace rules = candela::adaptive;

Result<void> check(const EpochSettings& settings) {
  if (settings.epoch_min % 2 == 0) return {};
  return usage_error(fmt::format("'{}' is not an even number", settings.epoch_min))
      .with_field("epoch_min")
      .with_mend("an epoch has as many iterations of either half of a job");
}

Result<void> check(const PlugInSettings& settings) {
  if (settings.r_min <= settings.r_max) return {};
  return usage_error(fmt::format("'{}' is below r_min = {}", settings.r_max, settings.r_min))
      .with_field("r_max");
}

namespace {

Adaptation make_adaptation(const EpochSettings& epochs, std::string_view rule, rules::Levels levels) {
  Adaptation adaptation;
  EpochPlan& plan = adaptation.epochs;
  plan.first = static_cast<std::uint64_t>(epochs.epoch_min);
  plan.growth = static_cast<std::uint32_t>(epochs.growth);
  plan.lag = static_cast<std::uint32_t>(epochs.lag);
  plan.rule = rule;
  rules::put_levels(levels, plan.constants);
  adaptation.levels = std::move(levels);
  return adaptation;
}

}  // namespace

bool tests_colors(const FTestSettings& test, bool scene_has_color) {
  return test.channels.value == "colors" || (test.channels.value == "auto" && scene_has_color);
}

Adaptation f_test(const EpochSettings& epochs, const FTestSettings& test, bool colors) {
  Adaptation adaptation =
      make_adaptation(epochs, "fppm", rules::levels_above(test.k, test.r_min, test.floor_alpha));
  EpochPlan& plan = adaptation.epochs;
  constexpr int kDegrees = rules::kSectorChannels - 1;
  // Bonferroni: the channels of a photon may be one or have nothing in common.
  const double level = colors ? test.alpha_f / rules::kColors : test.alpha_f;
  plan.constants["critical"] =
      std::to_string(rules::critical_integer(rules::chi_squared_quantile(level, kDegrees) / kDegrees));
  using Specs = std::vector<film::AccumulatorSpec>;
  if (colors)
    adaptation.accumulators = +[](int film_scale_log2) -> Specs {
      return {rules::sectors_spec(film_scale_log2, rules::kColors),
              rules::squares_spec(film_scale_log2, rules::kColors)};
    };
  else
    adaptation.accumulators = +[](int film_scale_log2) -> Specs {
      return {rules::sectors_spec(film_scale_log2), rules::squares_spec(film_scale_log2)};
    };
  return adaptation;
}

void follow(Adaptation& adaptation, double alpha, const Follow& none, const Follow& little) {
  SettingsMap& constants = adaptation.epochs.constants;
  for (const auto& [of, suffix] : {std::pair{none, ""}, std::pair{little, "_little"}}) {
    const std::vector<std::uint64_t> iterations =
        rules::levels_beside(adaptation.levels.factor, alpha, of.to_alpha, adaptation.levels.max_level);
    if (iterations.empty()) continue;
    constants[std::string("follow") + suffix] = rules::iterations_text(iterations);
    constants[std::string("evidence") + suffix] = std::to_string(of.evidence);
  }
}

Adaptation count_test(const EpochSettings& epochs, const CountTestSettings& test) {
  // Areas by thirds of a halving: the inner disc is three levels down, and a rejection is one.
  constexpr double kFactor = 0.89089871814033930;  // 2^(-1/6)
  Adaptation adaptation =
      make_adaptation(epochs, "cppm", rules::levels_above(kFactor, test.r_min, test.floor_alpha));
  SettingsMap& constants = adaptation.epochs.constants;
  const auto critical = [&](int sectors) {
    return std::to_string(rules::critical_integer(rules::chi_squared_quantile(test.alpha_chi, sectors - 1)));
  };
  constants["critical_outer"] = critical(rules::kSectorChannels);
  constants["critical_inner"] = critical(rules::kSectorsPerRing);
  constants["first_batch"] = std::to_string(test.first_batch);
  constants["batch_growth"] =
      std::to_string(static_cast<std::uint64_t>(std::floor(test.batch_growth * 0x1p16 + 0.5)));
  constants.emplace("halving_levels", "3");
  adaptation.accumulators =
      +[](int /*film_scale_log2*/) -> std::vector<film::AccumulatorSpec> { return {rules::counts_spec()}; };
  return adaptation;
}

namespace {

template <bool kMedia, bool kMeans>
std::vector<film::AccumulatorSpec> plug_in_accumulators(int film_scale_log2) {
  std::vector<film::AccumulatorSpec> specs = {rules::moments_spec(film_scale_log2, kMedia),
                                              rules::laplacian_spec(film_scale_log2, kMedia)};
  if (kMeans) specs.push_back(rules::means_spec(film_scale_log2));
  return specs;
}

}  // namespace

Adaptation plug_in(const EpochSettings& epochs, const PlugInSettings& bandwidth, transport::Kernel kernel,
                   bool media) {
  constexpr double kFactor = 0.95760328069857365;  // 2^(-1/16)
  // k2 and k3 of the kernels on the unit disc and ball (worker/transport/kernels.h): second moment along an
  // axis, and integral of the square. C: energy of the stencil of five discs.
  constexpr double kSecondMoment[] = {1.0 / 4, 1.0 / 6, 5.0 / 48};
  constexpr double kBallSecondMoment[] = {1.0 / 5, 1.0 / 7, 7.0 / 75};
  constexpr double kStencilEnergy[] = {2.84615, 4.79888, 11.4011};
  const int of_kernel = static_cast<int>(kernel);
  Adaptation adaptation = make_adaptation(epochs, "appm", {kFactor, rules::kMaxLevel});
  SettingsMap& constants = adaptation.epochs.constants;
  constants["c6"] = rules::constant_text(
      rules::plug_in_constant(kSecondMoment[of_kernel], 1 / transport::effective_area(kernel, 1)));
  if (media) {
    const rules::PlugInMedia in_media = rules::plug_in_media(
        kSecondMoment[of_kernel], kBallSecondMoment[of_kernel], 1 / transport::effective_volume(kernel, 1));
    constants["c7"] = rules::constant_text(in_media.c7);
    constants["k2_ratio"] = rules::constant_text(in_media.k2_ratio);
  }
  constants["r_min"] = rules::constant_text(bandwidth.r_min);
  constants["r_max"] = rules::constant_text(bandwidth.r_max);
  const bool reference = bandwidth.pilot.value == "reference";
  if (reference) {
    constants["pilot_c10"] =
        rules::constant_text(rules::reference_constant(kSecondMoment[of_kernel], kStencilEnergy[of_kernel]));
    adaptation.planes = {rules::kPilotLevels};
  }
  adaptation.accumulators =
      media ? (reference ? plug_in_accumulators<true, true> : plug_in_accumulators<true, false>)
            : (reference ? plug_in_accumulators<false, true> : plug_in_accumulators<false, false>);
  return adaptation;
}

WorkPlan work_plan(const Adaptation& adaptation, int film_scale_log2) {
  WorkPlan plan;
  plan.accumulators = adaptation.accumulators(film_scale_log2);
  plan.epochs = adaptation.epochs;
  return plan;
}

void note_statistics(const Adaptation& adaptation, Plan& plan) {
  std::uint32_t channels = 0;
  for (const film::AccumulatorSpec& spec : adaptation.accumulators(0)) channels += spec.channels;
  plan.use("a radius for each pixel",
           fmt::format("decided by the rule {} once an epoch, of {} iterations or 1/{} "
                       "of those before; {} levels, {} byte{} a pixel",
                       adaptation.epochs.rule, adaptation.epochs.first, adaptation.epochs.growth,
                       adaptation.levels.max_level + 1, 1 + adaptation.planes.size(),
                       adaptation.planes.empty() ? "" : "s"));
  plan.use("statistics",
           fmt::format(
               "{0} sums a pixel: a worker has {1} bytes a pixel, the master {1} for each of {2} epochs; at "
               "most {1} bytes a pixel cross the network for a unit, about {3} where photons are dense",
               channels, 8 * channels, adaptation.epochs.lag + 2, 4 * channels));
}

Result<std::string_view> level_map(const UnitInput& input, const Adaptation& adaptation,
                                   const UnitContext& context, std::size_t plane) {
  const auto state = input.states.find(adaptation.epochs.rule);
  const auto bad = [&](std::string_view what) {
    return input_error(fmt::format("the state '{}' {}", adaptation.epochs.rule, what)).with_field("states");
  };
  if (state == input.states.end()) return bad("of the unit's epoch is missing");
  const std::size_t pixels = std::size_t{context.width} * context.height;
  if (state->second.size() != (1 + adaptation.planes.size()) * pixels)
    return bad(fmt::format("has {} bytes, the film {} x {} pixels", state->second.size(), context.width,
                           context.height));
  const auto map = [&](std::size_t k) { return std::string_view(state->second).substr(k * pixels, pixels); };
  for (std::size_t k = 0; k <= adaptation.planes.size(); ++k) {
    const int levels = k == 0 ? adaptation.levels.max_level + 1 : adaptation.planes[k - 1];
    const std::string_view bytes = map(k);
    const auto too_deep = [&](char level) { return static_cast<unsigned char>(level) >= levels; };
    if (std::any_of(bytes.begin(), bytes.end(), too_deep))
      return bad(fmt::format("has a level beyond {}", levels - 1));
  }
  return map(plane);
}

}  // namespace candela::integrators::adaptive
