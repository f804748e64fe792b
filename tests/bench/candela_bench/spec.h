// Runs to be made: which scene with which integrator, settings and seed, and for how long.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"

namespace candela::bench {

// One run: an estimator whose image gets better with its units. All that its pixels depend on, and where its
// error is measured.
struct RunSpec {
  std::string scene;       // its name in rows and plots
  std::string scene_file;  // absolute
  std::string scene_hash;  // of the bundle: the scene file and all that it refers to
  std::string variant;     // the name of this integrator with these settings
  SettingsMap given;       // settings as given, without what the scene or defaults add
  JobSettings job;         // complete
  unsigned threads = 1;
  std::string reference;       // absolute path of an EXR
  std::string reference_hash;  // of what it and its standard errors hold

  std::string to_json() const;
  static Result<RunSpec> from_json(std::string_view text);
  // Names the run among all, as a file may be called: the names and the seed, and a hash of the above, but
  // for paths, with the build.
  std::string id() const;
};

struct Budget {
  std::uint64_t iterations = 0;  // one of these two is 0
  double seconds = 0;
  bool wall_clock = false;     // seconds are CPU seconds unless this is set
  double slice_seconds = 0.5;  // of one run's turn
  double first_seconds = 0.125;
  int points_per_doubling = 1;
};

// Measured over the reference's own squared error, from which on a row is good.
inline constexpr double kReferenceFactor = 10;

// Content of a list and of the options of `run`.
struct Work {
  std::vector<RunSpec> runs;
  Budget budget;
  std::string out;  // folder; empty: rows go to standard output and nothing is kept
  double reference_factor = kReferenceFactor;
  bool flip = true;
  std::size_t beside = 0;  // runs that are in memory at a time; 0: all
};

struct RunOptions {
  std::string list;  // TOML file; empty: the options say all
  // The file; with a list: names of its scenes, the only ones to run. Names, here and of integrators, may
  // stand in one string with commas between.
  std::vector<std::string> scenes;
  std::string reference, name;  // of the one scene, without a list
  std::vector<std::string> integrators, sets;
  std::vector<std::uint64_t> seeds;
  std::optional<std::uint64_t> iterations;
  std::optional<double> seconds;
  std::optional<std::string> clock;
  std::optional<unsigned> threads;
  std::optional<std::string> out;
  std::optional<double> reference_factor, slice_seconds;
  std::optional<std::size_t> beside;
  std::optional<int> points_per_doubling;
  bool no_flip = false;
};
// Reads the list, applies the options over it, checks all names, files and settings. Errors name the file and
// line, or the option.
Result<Work> prepare(const RunOptions& options);

// "key=value" or "integrator.key=value": settings for those integrators that have them. It is an error if
// none of `integrators` has one.
Result<SettingsMap> settings_for(const std::string& integrator, const std::vector<std::string>& integrators,
                                 const std::vector<std::string>& sets);

// A run of this scene: the scene's own settings where the integrator has them, `given` over them.
Result<RunSpec> make_run(const std::string& scene_file, const std::string& scene_name,
                         const std::string& integrator, const SettingsMap& given, std::uint32_t width,
                         std::uint32_t height);

// scene.xml has its folder's name, any other file its own.
std::string scene_name_of(const std::filesystem::path& file);

// The command that makes the row of `iterations` units again.
std::string command_of(const RunSpec& run, std::uint64_t iterations, bool flip,
                       double reference_factor = kReferenceFactor);

// As a file of that name is called: what is not a letter, digit, '-' or '.' of ASCII is '_', a byte each.
std::string file_name_of(std::string_view name);

}  // namespace candela::bench
