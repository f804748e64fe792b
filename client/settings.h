// From a scene and the options of a command to the complete, immutable settings of a job. What the options
// leave open the scene says (film size, rfilter, integrator and its settings, sampler's sample_count and
// seed), and what the scene leaves open are Mitsuba's documented defaults.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/bundle/bundle.h"
#include "common/job/job.h"

namespace candela::client {

// What the client must know of the renderer, without linking it: injected by the program.
struct RendererFacts {
  std::function<std::vector<std::string>()> integrator_names;
  std::function<Result<std::vector<std::string>>(const std::string& integrator)> setting_names;
  std::function<Result<SettingsMap>(const std::string& integrator, const SettingsMap& from_scene,
                                    const SettingsMap& from_user)>
      complete_settings;
};

// The options that `render`, `submit` and `plan` share, as typed.
struct SceneOptions {
  std::string scene;                 // path of the scene file
  std::vector<std::string> defines;  // name=value
  std::vector<std::string> sets;     // key=value
  std::optional<std::string> integrator, iterations, time, until, seed, size, filter, sampler, isa;
  bool lenient = false;  // unknown parameters and elements of the scene are warnings

  description::Reading reading() const { return {.integrator = integrator.value_or(""), .lenient = lenient}; }
};

struct PreparedJob {
  JobSettings settings;
  StopRule stop;
  bool stop_given = false;  // by an option; else it is the scene's sample_count
  // If --integrator passes over an integrator of the scene: which one, and what of it counts.
  std::optional<description::Note> other_integrator = {};
};

// The limits given as options alone; all zero if none is.
Result<StopRule> parse_stop(const std::optional<std::string>& iterations,
                            const std::optional<std::string>& time, const std::optional<std::string>& until);

Result<std::map<std::string, std::string>> parse_assignments(const std::vector<std::string>& texts,
                                                             std::string_view option);

// Errors (usage) name the option, (input) the scene's file and line.
Result<PreparedJob> prepare_job(const description::SceneDescription& scene, const SceneOptions& options,
                                const RendererFacts& facts);

// Reads the scene and everything it refers to, and prepares its job. Checks of options that need no scene
// come first.
struct LoadedScene {
  bundle::GatheredScene gathered;
  PreparedJob job;
};
Result<LoadedScene> load_scene(const SceneOptions& options, const RendererFacts& facts);

// What differs between two settings, one line ("seed is 1, was 0; width is ..."); empty if nothing does.
std::string difference(const JobSettings& now, const JobSettings& was);

}  // namespace candela::client
