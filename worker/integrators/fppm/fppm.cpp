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

std::unique_ptr<Integrator> make_by_sectors(const FppmSettings& settings, Planned planned, bool colors) {
  return adaptive::make_photon_mapping<transport::WeightedSectors>(
      settings, std::move(planned), adaptive::f_test(settings.epochs, settings.f_test, colors),
      [colors](double first_radius, const auto&...) {
        return transport::WeightedSectors(first_radius, colors);
      });
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
  if (parsed.rings.test.value == "nested")
    return make<transport::WeightedRings<1>>(parsed, std::move(planned), adaptive::ring_test);
  return make_by_sectors(parsed, std::move(planned),
                         adaptive::tests_colors(parsed.f_test, features.any_color));
}

}  // namespace candela::integrators
