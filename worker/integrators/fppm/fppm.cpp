// Progressive photon mapping whose radius follows, at each pixel, from F tests of the light in sectors around
// the gather points [Lin 2023].
#include "worker/integrators/adaptive/photon_mapping.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/ppm/plan.h"
#include "worker/transport/statistics/weighted_sectors.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_fppm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const adaptive::FppmSettings parsed, parse_settings<adaptive::FppmSettings>(settings));
  CANDELA_TRY(adaptive::check(parsed.epochs));
  const bool colors = adaptive::tests_colors(parsed.rule, features.any_color);
  return adaptive::make_photon_mapping<transport::WeightedSectors>(
      parsed, ppm::plan(parsed.common.path_options(), false, features, parsed.common.full_plan()),
      adaptive::f_test(parsed.epochs, parsed.rule, colors), [colors](double first_radius, const auto&...) {
        return transport::WeightedSectors(first_radius, colors);
      });
}

}  // namespace candela::integrators
