// The renderer's one door: a compiled scene with its integrator, that turns units into films. No farm, no
// network here.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/chains/chains.h"
#include "common/description/object.h"
#include "common/film/unit_film.h"
#include "common/job/job.h"
#include "worker/integrators/run_context.h"
#include "worker/integrators/settings.h"
#include "worker/scene/textures/scratch.h"

namespace candela::scene {
struct SceneFeatures;
}

namespace candela::render {

// ISAs of Embree this machine can use, of "sse2", "sse4.2", "avx", "avx2", "avx512".
std::vector<std::string> supported_isas();

using integrators::RunContext;

class Renderer {
 public:
  virtual ~Renderer() = default;

  // Loads, validates and compiles. The scene is independent of the film size and the seed. What `textures`
  // allows does not change a bit of the image.
  static Result<std::unique_ptr<Renderer>> create(const description::FileSource& files,
                                                  const std::string& main_key,
                                                  const std::map<std::string, std::string>& parameters,
                                                  const JobSettings& settings, unsigned threads,
                                                  const scene::TextureLimits& textures = {});

  // A film of the job's size for run() to add into.
  virtual std::unique_ptr<film::UnitFilm> make_film(const NamedState& state) const = 0;

  // Pure functions of (scene, settings, unit): not of threads, time, or what ran before. The film must be
  // clear.
  virtual Result<PilotResult> pilot(const RunContext& context) const = 0;
  virtual Result<void> run(const Unit& unit, film::UnitFilm& film, const RunContext& context) const = 0;

  // Jobs of Markov chains (PilotResult::chains). Others answer with an internal error.
  //
  // The scalar contributions of bootstrap samples [begin, end), `contributions` being as long: finite and not
  // negative. A sample that was neither is 0 and counted in the tallies by its cause.
  virtual Result<film::Tallies> bootstrap(std::uint64_t begin, std::uint64_t end,
                                          std::span<float> contributions, const RunContext& context) const;
  // A unit of segments, none of a chain twice: `starts` and the new `records` one for each index, in order.
  // state.bootstrap_b may be 0 (nothing found): chains then stand still and only what needs no chain is
  // added. An input error where a start cannot be one of this job and index. Nothing in `records` is to be
  // used after an error.
  virtual Result<void> run_segments(const Unit& unit, const NamedState& state,
                                    std::span<const chains::ChainStart> starts, film::UnitFilm& film,
                                    std::vector<chains::ChainRecord>& records,
                                    const RunContext& context) const;

  // The integrator's plan as text: features found, what will run, what is skipped and why.
  virtual std::string plan_text() const = 0;

  // The scene's facts; null where there is no scene behind (in tests).
  virtual const scene::SceneFeatures* features() const { return nullptr; }
};

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

}  // namespace candela::render
