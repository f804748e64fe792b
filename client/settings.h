// From a scene and the options of a command to the complete, immutable settings of a job. What the options
// leave open the scene says (film size, rfilter, integrator and its settings, sampler's sample_count and
// seed), and what the scene leaves open are Mitsuba's documented defaults.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/bundle/gather.h"
#include "common/film/index_text.h"
#include "common/job/effort.h"
#include "common/job/job.h"
#include "common/stages/work_plan.h"

namespace candela::client {

struct LoadedScene;

// A setting of an integrator, as `candela help INTEGRATOR` prints it.
struct IntegratorSetting {
  std::string name, type, default_value, doc;
};

// Facts of the renderer that the client needs, without linking it: injected by the program.
struct RendererFacts {
  std::function<std::vector<std::string>()> integrator_names;
  std::function<Result<std::vector<std::string>>(const std::string& integrator)> setting_names;
  std::function<Result<SettingsMap>(const std::string& integrator, const SettingsMap& from_scene,
                                    const SettingsMap& from_user)>
      complete_settings;
  std::function<Result<std::vector<IntegratorSetting>>(const std::string& integrator)> setting_docs;
  std::function<std::vector<std::string>()> supported_isas;  // that this machine's Embree can use
  // The work that a job asks of the farm: of these settings with any scene at most, and of this scene, which
  // is loaded for that. Empty: nothing is known.
  std::function<Result<WorkPlan>(const JobSettings&)> largest_work;
  std::function<Result<WorkPlan>(const LoadedScene&)> work_of;
  // Settings that follow from an effort where nobody gives them: the same names for every effort.
  std::function<Result<SettingsMap>(const std::string& integrator, const Effort& effort)> settings_of_effort;
  // Samples, or mutations, that one iteration brings to a pixel.
  std::function<Result<std::uint64_t>(const std::string& integrator, const SettingsMap& settings)>
      samples_per_iteration;
};

// The options that `render`, `submit` and `plan` share, as typed.
struct SceneOptions {
  std::string scene;                 // path of the scene file
  std::vector<std::string> defines;  // name=value
  std::vector<std::string> sets;     // key=value
  std::optional<std::string> integrator, spp, iterations, time, until, indices, seed, size, crop, filter,
      sampler, isa, aov, scene_memory;
  std::vector<std::string> layers;   // NAME=EXPR, or as the job has them
  std::vector<std::string> regions;  // NAME=box:... or NAME=sphere:...
  std::optional<std::string> glossy_below;
  bool light_groups = false, partition = false;
  std::optional<std::string> edits;  // a file, or its JSON; none: no edits
  bool lenient = false;              // unknown parameters, elements and plugins of the scene are warnings

  description::Reading reading() const { return {.integrator = integrator.value_or(""), .lenient = lenient}; }
};

struct PreparedJob {
  JobSettings settings;
  StopRule stop;
  film::HalfSets indices;   // exactly these end the job, and no limit of `stop`; empty: it has none
  bool stop_given = false;  // by an option; else it is the scene's sample_count
  std::uint64_t spp = 0;    // what stop.iterations were made of; 0: they were given, or there is no limit
  // The integrator's settings that nobody gave and that follow from the effort.
  SettingsMap of_effort = {};
  // If --integrator passes over an integrator of the scene: which one, and what of it counts.
  std::optional<description::Note> other_integrator = {};
  // If neither the scene nor the command line names an integrator: which one runs.
  std::optional<description::Note> default_integrator = {};
};

// The limits given as options alone, without --spp; all zero if none is. --spp and --iterations exclude each
// other.
Result<StopRule> parse_stop(const SceneOptions& options);
// --indices, which excludes all other limits; empty: it is not given.
Result<film::HalfSets> parse_exact_indices(const SceneOptions& options);

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
  std::filesystem::path folder;    // of the scene file
  std::uint64_t memory_bytes = 0;  // that reading it may take; 0: the default
  std::string path = {};           // of the scene file, as typed
};
// Fails on an option that is wrong whatever the scene is, and on a configuration that cannot be read.
Result<void> check_options(const SceneOptions& options);
// `hashes`: of other scenes that share files; null: there are none.
Result<LoadedScene> load_scene(const SceneOptions& options, const RendererFacts& facts,
                               bundle::FileHashes* hashes = nullptr);

// --scene-memory, else that of the configuration; 0: neither is given.
Result<std::uint64_t> scene_memory_bytes(const SceneOptions& options);

// Iterations that bring at least `spp` samples, or mutations, to each pixel.
std::uint64_t iterations_of(std::uint64_t spp, std::uint64_t samples_per_iteration);

// Takes from the settings of a job that was begun what follows from the effort alone: a job that is extended
// keeps it.
Result<void> keep_effort_of(const JobSettings& was, const RendererFacts& facts, PreparedJob& job);

// Differences of two settings, one line ("seed is 1, was 0; width is ..."); empty if nothing does.
std::string difference(const JobSettings& now, const JobSettings& was);

}  // namespace candela::client
