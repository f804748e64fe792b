#include "worker/integrators/fppm/fppm.h"

#include "worker/integrators/adaptive/photon_mapping.h"
#include "worker/integrators/ppm/plan.h"
#include "worker/transport/statistics/weighted_rings.h"
#include "worker/transport/statistics/weighted_sectors.h"

namespace candela::integrators {
namespace {

template <class Statistics, class MakeAdaptation>
std::unique_ptr<Integrator> make(const FppmSettings& settings, Planned planned,
                                 const MakeAdaptation& make_adaptation) {
  return adaptive::make_photon_mapping<Statistics>(
      settings, std::move(planned), make_adaptation(settings.epochs, settings.f_test, settings.rings),
      [](double first_radius, const auto&...) { return Statistics(first_radius); });
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_fppm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const FppmSettings parsed, parse_settings<FppmSettings>(settings));
  CANDELA_TRY(adaptive::check(parsed.epochs));
  CANDELA_TRY(adaptive::check(parsed.f_test, parsed.rings));
  Planned planned = ppm::plan(parsed.common.path_options(), false, features, parsed.common.full_plan());
  if (parsed.rings.rings)
    return make<transport::WeightedRings<6>>(parsed, std::move(planned), adaptive::ring_test);
  if (parsed.f_test.test.value == "nested")
    return make<transport::WeightedRings<1>>(parsed, std::move(planned), adaptive::ring_test);
  return make<transport::WeightedSectors>(parsed, std::move(planned),
                                          [](const auto& epochs, const auto& test, const auto& /*rings*/) {
                                            return adaptive::f_test(epochs, test);
                                          });
}

}  // namespace candela::integrators
