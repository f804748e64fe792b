// The interface of all integrators.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/effort.h"
#include "common/job/job.h"
#include "common/stages/work_plan.h"
#include "worker/core/vec.h"
#include "worker/film/filter.h"
#include "worker/integrators/plan.h"
#include "worker/integrators/run_context.h"
#include "worker/integrators/settings.h"
#include "worker/integrators/unit_data.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/features.h"

namespace candela::scene {
class Scene;
}
namespace candela::transport {
class PathLetters;
}

namespace candela::integrators {

// All that a unit may depend on, beside its own index.
struct UnitContext {
  const scene::Scene& scene;
  const film::PixelFilter& filter;
  samplers::SamplerKind sampler;
  std::uint64_t seed;
  std::uint32_t width, height;
  // Camera pixels per pixel of this film, by axis: above 1 in a pilot, whose film is smaller than the
  // camera's.
  Vec2 camera_units{1, 1};
  // Letters for layers by light path expressions; null: the job has none.
  const transport::PathLetters* letters = nullptr;
};

// Pixels.
struct FilmSize {
  std::uint32_t width = 0, height = 0;
};

// Decision of a pilot for a whole job.
struct Decision {
  // NamedState::decided of every unit, at most Limits::max_decided_bytes (decision_bytes.h). Empty: scene and
  // settings leave nothing open.
  std::string bytes;
  Plan plan;  // what will run
};

class Integrator {
 public:
  virtual ~Integrator() = default;

  // Decides what scene and settings leave open, by trials if need be: a pure function of the context. The
  // pilot of a job calls it once; no unit repeats it. Fails only if it is stopped.
  virtual Result<Decision> decide(const UnitContext& context, const RunContext& run) const = 0;

  // The work that a job of this integrator asks of the farm: a pure function of scene, settings, film size,
  // and the pilot's state, {} before it. Only scales of accumulators may depend on the film's scale. Only
  // accumulators and the development may depend on what is decided; before that, or with bytes that decide()
  // did not write, the work is the most that it may be. The pilot fails where the result does not pass
  // validate() of work_plan.h. Units are iterations, or, with chains, bootstrap samples and segments
  // (common/chains/chains.h); the first layers of a job of chains are the chains' part and what independent
  // samples brought. Each layer is summed and developed as the image is: a mean over iterations.
  virtual WorkPlan work(FilmSize /*size*/, const NamedState& /*state*/) const { return {}; }

  // Adds to `output` what the unit brings: a pure function of (context, unit, input), whatever the threads.
  // Precondition: the unit is of the plan's kinds, and input and output are what such a unit has. Fails
  // (input) on bytes that decide() did not write.
  virtual Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input,
                           UnitOutput& output, const RunContext& run) const = 0;

  // The radiance of `count` samples spread over the film, in a fixed order, from the pilot's own streams:
  // what the film's scale is chosen from. NaN and infinite samples are left out.
  virtual std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const = 0;
};

// One line of the registry.
struct IntegratorEntry {
  std::string_view name;
  Result<std::unique_ptr<Integrator>> (*create)(const SettingsMap& settings,
                                                const scene::SceneFeatures& features);
  // All settings as text with defaults filled in, or the error of what was given.
  Result<SettingsMap> (*complete)(const SettingsMap& given);
  std::vector<SettingDoc> (*document)();
  // Settings that follow from an effort where nobody gives them: the same names for every effort.
  SettingsMap (*of_effort)(const Effort& effort);
  // Samples, or mutations, that one iteration brings to a pixel, of complete settings.
  Result<std::uint64_t> (*samples_per_iteration)(const SettingsMap& settings);
};
const std::vector<IntegratorEntry>& registry();
// An unknown name is a usage error that lists what there is.
Result<const IntegratorEntry*> find_integrator(std::string_view name);

}  // namespace candela::integrators
