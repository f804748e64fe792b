// The renderer's one door: a compiled scene with its integrator, that turns units into films. No farm, no
// network here.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/job/effort.h"
#include "common/job/job.h"
#include "common/stages/work_plan.h"
#include "worker/integrators/run_context.h"
#include "worker/integrators/settings.h"
#include "worker/integrators/unit_data.h"
#include "worker/scene/textures/scratch.h"

namespace candela::scene {
struct SceneFeatures;
}

namespace candela::render {

// ISAs of Embree this machine can use, of "sse2", "sse4.2", "avx", "avx2", "avx512".
std::vector<std::string> supported_isas();

using integrators::RunContext;
using integrators::UnitInput;
using integrators::UnitOutput;

class Renderer {
 public:
  virtual ~Renderer() = default;

  // Loads, validates and compiles. The scene is independent of the film size and the seed. What `textures`
  // allows does not change a bit of the image. `memory_bytes`: what reading and building the scene may take;
  // 0: the default of description::ReadingBudget. Ends as "stopped" where the thread's WorkMonitor says so;
  // so do pilot() and run().
  static Result<std::unique_ptr<Renderer>> create(const description::FileSource& files,
                                                  const std::string& main_key,
                                                  const std::map<std::string, std::string>& parameters,
                                                  const JobSettings& settings, unsigned threads,
                                                  const scene::TextureLimits& textures = {},
                                                  std::uint64_t memory_bytes = 0);

  // Pure functions of (scene, settings, unit, input): not of threads, time, or what ran before.
  virtual Result<PilotResult> pilot(const RunContext& context) const = 0;

  // An output for a unit that brings a film: film and accumulators of the job's size, clear. With another
  // state than the pilot's the unit may not fit to it.
  virtual UnitOutput make_output(const NamedState& state) const = 0;
  // Adds to `output`, which is of make_output(), or an empty one for a unit that brings no film. It is clear,
  // or has the sums of other iterations of this half and epoch: then it is the output of all of them. An
  // error of kind input where the unit's input cannot be one of this job; nothing of the output may be used
  // after any.
  virtual Result<void> run(const Unit& unit, const UnitInput& input, UnitOutput& output,
                           const RunContext& context) const = 0;

  // The integrator's plan as text: features found, what will run, what is skipped and why. It makes the same
  // trials as the pilot, and fails as it does.
  virtual Result<std::string> plan_text() const = 0;

  // The scene's facts; null where there is no scene behind (in tests).
  virtual const scene::SceneFeatures* features() const { return nullptr; }
};

// As Renderer::create, for the scene's facts alone: no tree of its shapes is built where they do without, and
// its memory is not counted.
Result<scene::SceneFeatures> check_scene(const description::FileSource& files, const std::string& main_key,
                                         const std::map<std::string, std::string>& parameters,
                                         const JobSettings& settings, unsigned threads,
                                         std::uint64_t memory_bytes);

// Names of the integrators there are, and the settings of one as (name, default, doc) for --help, docs and
// validation.
using integrators::SettingDoc;
std::vector<std::string> integrator_names();
Result<std::vector<SettingDoc>> integrator_settings(const std::string& integrator);
// Parses, fills in defaults, and writes all settings out as text. Unknown names and bad values are usage
// errors with the nearest known name. `from_scene` are the properties of the scene's integrator element,
// overridden by `from_user`.
Result<SettingsMap> complete_integrator_settings(const std::string& integrator, const SettingsMap& from_scene,
                                                 const SettingsMap& from_user);
// Settings that follow from an effort where nobody gives them: the same names for every effort.
Result<SettingsMap> integrator_settings_of_effort(const std::string& integrator, const Effort& effort);
// Samples, or mutations, that one iteration of an integrator with these complete settings brings to a pixel.
Result<std::uint64_t> samples_per_iteration(const std::string& integrator, const SettingsMap& settings);

// The work that a job of these settings asks of the farm, without its scene: with the most statistics that
// any scene makes of them.
Result<WorkPlan> largest_work(const JobSettings& settings);

}  // namespace candela::render
