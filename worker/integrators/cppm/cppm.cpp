// Progressive photon mapping whose radius follows, at each pixel, from chi-squared tests of the numbers of
// photons in sectors around the gather points [Lin 2020].
#include "worker/integrators/adaptive/photon_mapping.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/ppm/plan.h"
#include "worker/transport/statistics/counts.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_cppm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const adaptive::CppmSettings parsed, parse_settings<adaptive::CppmSettings>(settings));
  CANDELA_TRY(adaptive::check(parsed.epochs));
  return adaptive::make_photon_mapping<transport::SectorCounts>(
      parsed, ppm::plan(parsed.common.path_options(), false, features, parsed.common.full_plan()),
      adaptive::count_test(parsed.epochs, parsed.rule),
      [](double /*first_radius*/, const auto&...) { return transport::SectorCounts(); });
}

}  // namespace candela::integrators
