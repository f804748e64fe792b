// Progressive photon mapping whose radius minimizes, at each pixel, the mean squared error as estimated from
// the second moment and the Laplacian of the light around the gather points [Kaplanyan 2017, chapter 5].
#include <vector>

#include "common/adaptive/plug_in.h"
#include "common/stages/epochs.h"
#include "worker/integrators/adaptive/photon_mapping.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/ppm/plan.h"
#include "worker/transport/statistics/plug_in.h"

namespace candela::integrators {
namespace {

// The statistics of a unit's eye paths: with the pilot of its epoch, and with pilot=reference those of its
// pixels.
class MakeMoments {
 public:
  MakeMoments(transport::Kernel kernel, adaptive::Adaptation adaptation)
      : kernel_(kernel),
        adaptation_(std::move(adaptation)),
        epochs_(adaptation_.epochs.first, adaptation_.epochs.growth) {}

  struct Moments {
    std::vector<transport::SurfacePilot> pilots;  // by level
    transport::PlugInMoments moments;             // points into them
    // NOLINTNEXTLINE(google-explicit-constructor)
    operator const transport::PlugInMoments&() const { return moments; }
  };

  // Precondition: level_map() accepts the input's state.
  Moments operator()(double first_radius, const UnitContext& context, const Unit& unit,
                     const UnitInput& input) const {
    const std::uint64_t begin = epochs_.begin(epochs_.of_index(unit.begin));
    const double pilot = clamped(first_radius * candela::adaptive::pilot_bandwidth(begin));
    if (adaptation_.planes.empty()) return {{}, {kernel_, first_radius, pilot}};
    std::vector<transport::SurfacePilot> pilots;
    for (int g = 0; g < candela::adaptive::kPilotLevels; ++g)
      pilots.emplace_back(kernel_, first_radius,
                          clamped(first_radius * candela::adaptive::pilot_of_level(g)));
    const transport::PilotMap map{pilots, *adaptive::level_map(input, adaptation_, context, 1), context.width,
                                  context.height};
    return {std::move(pilots), {kernel_, first_radius, pilot, map}};
  }

 private:
  static double clamped(double radius) { return std::max(radius, adaptive::kMinRadius); }

  transport::Kernel kernel_;
  adaptive::Adaptation adaptation_;
  Epochs epochs_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_appm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const adaptive::AppmSettings parsed, parse_settings<adaptive::AppmSettings>(settings));
  CANDELA_TRY(adaptive::check(parsed.epochs));
  CANDELA_TRY(adaptive::check(parsed.rule));
  const transport::Kernel kernel = parsed.merge.rules().kernel;
  Planned planned = ppm::plan(parsed.common.path_options(), false, features, parsed.common.full_plan());
  const adaptive::Adaptation adaptation =
      adaptive::plug_in(parsed.epochs, parsed.rule, kernel, planned.techniques.merge_medium);
  return adaptive::make_photon_mapping<transport::PlugInMoments>(parsed, std::move(planned), adaptation,
                                                                 MakeMoments(kernel, adaptation));
}

}  // namespace candela::integrators
