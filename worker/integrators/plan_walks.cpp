#include "worker/integrators/plan_walks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "worker/core/math.h"
#include "worker/transport/roulette.h"

namespace candela::integrators {

namespace {

// The largest second moment of a walk's weight after at most `most` scatterings, of each of which `fraction`
// is left: roulette divides it by the survival (transport/roulette.h).
double largest_moment(double fraction, double most) {
  constexpr double kFirst = transport::kSlowEnds;
  const double steep = fraction / static_cast<double>(transport::kMaxSurvival);
  if (steep <= 1) return 1;
  if (most <= kFirst) return math::pow(steep, most);
  // Then it goes as n fraction^n.
  const double peak = fraction < 1 ? -1 / math::log(fraction) : most;
  const double n = std::clamp(peak, kFirst, most);
  return math::pow(steep, kFirst) * math::pow(fraction, n - kFirst) * n / kFirst;
}

}  // namespace

void note_lasting_media(const scene::SceneFeatures& features, std::uint32_t max_depth, std::uint32_t rr_depth,
                        Plan& plan) {
  if (features.emitters == 0 || max_depth <= rr_depth) return;
  const double most = std::min(max_depth - rr_depth, transport::kLongestWalk);
  if (!(largest_moment(static_cast<double>(features.lasting_fraction), most) > 10)) return;
  const auto thickness = static_cast<double>(features.lasting_thickness);
  plan.note(
      "media",
      fmt::format("{} that absorb next to nothing: Russian roulette makes this integrator noisy "
                  "there; path does not suffer from it",
                  std::isfinite(thickness) ? fmt::format("up to {:.3g} mean free paths across", thickness)
                                           : "mean free paths without an end"));
}

void plan_shadow_rays(const scene::SceneFeatures& features, Plan& plan) {
  std::uint32_t environments = 0;
  for (const auto& [kind, count] : features.emitter_kinds)
    if (kind == "constant" || kind == "envmap" || kind == "sky" || kind == "sun" || kind == "sunsky")
      environments += count;
  if (environments == 0 || features.emitters <= environments) return;
  if (features.environment_variation < 1)
    plan.use(
        "shadow rays to lamps",
        fmt::format("the environment is smooth (relative variance {:.2g}): scattered rays find it, and it "
                    "gets shadow rays where lamps give far less",
                    static_cast<double>(features.environment_variation)));
  else
    plan.use("shadow rays to lamps and to the environment",
             fmt::format("by what each gives: the environment is uneven (relative variance {:.2g})",
                         static_cast<double>(features.environment_variation)));
}

}  // namespace candela::integrators
