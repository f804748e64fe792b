// What every integrator is to the renderer.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/chains/chains.h"
#include "common/film/unit_film.h"
#include "common/job/job.h"
#include "worker/film/filter.h"
#include "worker/integrators/plan.h"
#include "worker/integrators/run_context.h"
#include "worker/integrators/settings.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/scene.h"

namespace candela::integrators {

// All that a unit may depend on, beside its own index.
struct UnitContext {
  const scene::Scene& scene;
  const film::PixelFilter& filter;
  samplers::SamplerKind sampler;
  std::uint64_t seed;
  std::uint32_t width, height;
};

class ChainIntegrator;

class Integrator {
 public:
  virtual ~Integrator() = default;

  // Adds the sums of the unit to the film: a pure function of (context, unit), whatever the threads.
  virtual Result<void> run(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                           const RunContext& run) const = 0;

  // The radiance of `count` samples spread over the film, in a fixed order, from the pilot's own streams:
  // what the film's scale is chosen from. NaN and infinite samples are left out.
  virtual std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const = 0;

  virtual const Plan& plan() const = 0;

  // Names of the film's further layers, beside the image: layers()[i] is the film's layer i + 1. Fixed from
  // creation on, the same for every unit; valid (film::validate_layer_names), which create() sees to where
  // settings decide. Each is summed and developed exactly as the image is: a mean over iterations.
  virtual std::vector<std::string> layers() const { return {}; }

  // This, if it is an integrator of Markov chains.
  virtual const ChainIntegrator* chains() const { return nullptr; }
};

// An integrator whose units are bootstrap samples and segments of Markov chains (common/chains/chains.h).
// The film's layers are the chains' part, what independent samples brought, and then its own, if any.
class ChainIntegrator : public Integrator {
 public:
  virtual ChainPlan chain_plan(std::uint32_t width, std::uint32_t height) const = 0;

  // Pure functions, as run(); render::Renderer says what they mean.
  virtual Result<film::Tallies> bootstrap(const UnitContext& context, std::uint64_t begin, std::uint64_t end,
                                          std::span<float> contributions, const RunContext& run) const = 0;
  virtual Result<void> run_segments(const UnitContext& context, const Unit& unit, const NamedState& state,
                                    std::span<const chains::ChainStart> starts, film::UnitFilm& film,
                                    std::vector<chains::ChainRecord>& records,
                                    const RunContext& run) const = 0;

  // There are no iterations.
  Result<void> run(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                   const RunContext& run) const final;
  const ChainIntegrator* chains() const final { return this; }
};

// One line of the registry.
struct IntegratorEntry {
  std::string_view name;
  Result<std::unique_ptr<Integrator>> (*create)(const SettingsMap& settings,
                                                const scene::SceneFeatures& features);
  // All settings as text with defaults filled in, or the error of what was given.
  Result<SettingsMap> (*complete)(const SettingsMap& given);
  std::vector<SettingDoc> (*document)();
};
const std::vector<IntegratorEntry>& registry();
// An unknown name is a usage error that lists what there is.
Result<const IntegratorEntry*> find_integrator(std::string_view name);

}  // namespace candela::integrators
