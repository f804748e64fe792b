// Context of every command, and the options that several commands share.
#pragma once

#include <functional>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/farm_client.h"
#include "client/settings.h"
#include "common/base/config.h"
#include "common/base/result.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace candela::client {

struct Context {
  std::ostream& out;  // results
  std::ostream& err;  // progress and errors
  RendererFacts facts;
  std::vector<std::string> arguments;    // as given, the program's name first
  std::function<Result<int>()> command;  // set by the parser: the chosen command, returning its exit code
};

// Sets what runs if the command `app` is chosen.
void set_command(CLI::App& app, Context& context, std::function<Result<int>()> command);
template <class Run, class Options>
void set_command(CLI::App& app, Context& context, Run run, const std::shared_ptr<Options>& options) {
  set_command(app, context, [&context, run, options] { return run(context, *options); });
}

// An option for a value that may be absent.
CLI::Option* add_text(CLI::App& app, const std::string& names, std::optional<std::string>& value,
                      const std::string& doc, const std::string& type);
// An option that may be given several times, one value each.
CLI::Option* add_texts(CLI::App& app, const std::string& names, std::vector<std::string>& values,
                       const std::string& doc, const std::string& type);

// An argument that may be absent.
void add_positional(CLI::App& app, const std::string& name, std::optional<std::string>& value,
                    const std::string& doc, const std::string& type);
// The ids or names of a command that may be about several jobs.
void add_job_words(CLI::App& app, std::vector<std::string>& words, const std::string& doc);

// SCENE, -D, --integrator, --lenient, --set, --iterations, --time, --until, --indices, --seed, --size,
// --filter,
// --sampler, --isa.
void add_scene_options(CLI::App& app, SceneOptions& options, bool with_limits);
// The same without SCENE, for a command whose layers are not named by options: no --layer, --light-groups and
// --partition.
void add_options_without_layers(CLI::App& app, SceneOptions& options);
// Some of these, for commands that have fewer: the scene and -D; -D; --lenient; --scene-memory.
void add_scene_file(CLI::App& app, SceneOptions& options);
void add_defines(CLI::App& app, SceneOptions& options);
void add_lenient(CLI::App& app, SceneOptions& options);
void add_scene_memory(CLI::App& app, SceneOptions& options);

// Tells on `err` what was passed over in the scene, and what `check` warns of: each thing once, with file,
// line and count, at most twenty lines.
void warn_of_scene(std::ostream& err, const LoadedScene& scene);

// --master, --tls-*, --token-file, --insecure, --timeout.
struct FarmOptions {
  std::optional<std::string> master, tls_cert, tls_key, tls_ca, token_file, timeout;
  bool insecure = false;
};
void add_farm_options(CLI::App& app, FarmOptions& options);
// By precedence: option, environment ($CANDELA_MASTER, ...), configuration files ("master", or [client]
// master).
Result<ConnectionOptions> resolve_connection(const FarmOptions& options, const Config& config);
// resolve, dial, and check the master's protocol.
Result<std::unique_ptr<FarmClient>> connect(const FarmOptions& options);

// 0 for a job that is done, 1 for one that failed or was cancelled.
int exit_code_of(const v1::JobStatus& status);

}  // namespace candela::client
