#include "worker/integrators/appm/appm.h"

#include "common/adaptive/plug_in.h"
#include "common/stages/epochs.h"
#include "worker/integrators/adaptive/photon_mapping.h"
#include "worker/integrators/ppm/plan.h"
#include "worker/transport/statistics/plug_in.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_appm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const AppmSettings parsed, parse_settings<AppmSettings>(settings));
  CANDELA_TRY(adaptive::check(parsed.epochs));
  CANDELA_TRY(adaptive::check(parsed.bandwidth));
  const transport::Kernel kernel = parsed.merge.rules().kernel;
  const adaptive::Adaptation adaptation = adaptive::plug_in(parsed.epochs, parsed.bandwidth, kernel);
  const auto pilot = parsed.bandwidth.pilot.value == "tenth" ? candela::adaptive::Pilot::tenth
                                                             : candela::adaptive::Pilot::eighth;
  return adaptive::make_photon_mapping<transport::PlugInMoments>(
      parsed, ppm::plan(parsed.common.path_options(), false, features, parsed.common.full_plan()), adaptation,
      [kernel, pilot, epochs = Epochs(adaptation.epochs.first, adaptation.epochs.growth)](double first_radius,
                                                                                          const Unit& unit) {
        const std::uint64_t begin = epochs.begin(epochs.of_index(unit.begin));
        return transport::PlugInMoments(
            kernel, first_radius,
            std::max(first_radius * candela::adaptive::pilot_bandwidth(pilot, begin),
                     adaptive::kLeastRadius));
      });
}

}  // namespace candela::integrators
