#include "worker/integrators/regularise.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "worker/core/math.h"

namespace candela::integrators {
namespace {

using transport::Connecting;

constexpr std::string_view kTechnique = "mollified connections";

// Why no path needs them; empty if some may.
std::string_view why_not(const scene::SceneFeatures& f, std::uint32_t max_depth, Connecting techniques) {
  if (max_depth < 2) return "max_depth shows emitters only";
  if (!f.any_delta_emitter) return "no light is a point or a direction: eye paths can meet all of them";
  if (!f.any_delta_bsdf) return "no surface is specular: every vertex can be connected";
  if (techniques == Connecting::bidirectional && f.finite_lens)
    return "the lens has an area: light paths can meet it";
  return {};
}

}  // namespace

double ChainRegularization::bandwidth(std::uint64_t mutation) const {
  if (!geometric_) return regularization_.bandwidth(mutation / kEpochMutations);
  // r_0 gamma^n as it was published [Kaplanyan 2017, section 6.3.2].
  constexpr double kGamma = 1 - 1e-4;
  return regularization_.first() *
         std::max(math::pow(kGamma, static_cast<double>(mutation)), transport::kMinShare);
}

Regularization plan_regularization(const RegulariseSettings& settings, const scene::SceneFeatures& features,
                                   std::uint32_t max_depth, Connecting techniques, Plan& plan) {
  if (!settings.on()) return {};
  if (const std::string_view why = why_not(features, max_depth, techniques); !why.empty()) {
    plan.skip(std::string(kTechnique), std::string(why));
    return {};
  }
  const double first = std::clamp(settings.radius * static_cast<double>(features.radius), 1e-12, 1e12);
  plan.use(std::string(kTechnique),
           fmt::format("light of points and directions over specular surfaces that no technique can sample: "
                       "blurred over a radius that {} {:.3g}",
                       settings.exponent > 0 ? "falls from" : "stays", first));
  return {first, settings.exponent, settings.layer};
}

Result<void> check(const Regularization& regularization, const scene::SceneFeatures& features) {
  if (regularization.runs() && features.reads_letters)
    return usage_error("layers by light path expressions do not know mollified paths")
        .with_field("regularise")
        .with_mend("leave out the expressions, or give regularise=off");
  if (regularization.runs() && !features.edits.empty())
    return usage_error("edits are not derived for mollified vertices: " + features.edits.front())
        .with_field("regularise")
        .with_mend("leave out the edits, or give regularise=off");
  return {};
}

}  // namespace candela::integrators
