#include "client/context.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "client/values.h"
#include "common/description/review.h"

namespace candela::client {

void set_command(CLI::App& app, Context& context, std::function<Result<int>()> command) {
  app.callback([&context, command = std::move(command)] { context.command = command; });
}

CLI::Option* add_text(CLI::App& app, const std::string& names, std::optional<std::string>& value,
                      const std::string& doc, const std::string& type) {
  return app
      .add_option_function<std::string>(
          names, [&value](const std::string& text) { value = text; }, doc)
      ->type_name(type);
}

CLI::Option* add_texts(CLI::App& app, const std::string& names, std::vector<std::string>& values,
                       const std::string& doc, const std::string& type) {
  return app.add_option(names, values, doc)->type_name(type)->allow_extra_args(false);
}

void add_positional(CLI::App& app, const std::string& name, std::optional<std::string>& value,
                    const std::string& doc, const std::string& type) {
  app.add_option_function<std::string>(
         name, [&value](const std::string& text) { value = text; }, doc)
      ->type_name(type);
}

void add_job_words(CLI::App& app, std::vector<std::string>& words, const std::string& doc) {
  app.add_option("ids", words, doc)->required()->type_name("ID...");
}

void add_scene_file(CLI::App& app, SceneOptions& options) {
  app.add_option("scene", options.scene, "Scene file (Mitsuba XML, or pbrt)")->required()->type_name("SCENE");
  add_defines(app, options);
}

void add_defines(CLI::App& app, SceneOptions& options) {
  add_texts(app, "-D,--define", options.defines, "Set a $parameter of the scene; may be repeated",
            "NAME=VALUE");
}

void add_lenient(CLI::App& app, SceneOptions& options) {
  app.add_flag("--lenient", options.lenient,
               "Accept unknown parameters, elements and plugins: leave them out, or use the nearest known "
               "plugin, with a warning");
}

void add_scene_memory(CLI::App& app, SceneOptions& options) {
  add_text(app, "--scene-memory", options.scene_memory,
           "Maximum memory for reading the scene, such as 500M or 20G; default: half of the memory", "SIZE");
}

namespace {

void add_job_options(CLI::App& app, SceneOptions& options, bool with_limits, bool with_layers) {
  add_text(app, "--integrator", options.integrator,
           "Integrator to use instead of the scene's, with the scene's values of common parameters", "NAME");
  add_lenient(app, options);
  add_texts(app, "--set", options.sets, "Set a setting of the integrator; may be repeated", "KEY=VALUE");
  if (with_limits) {
    add_text(app, "--spp", options.spp,
             "Stop after N samples per pixel (Markov chains: mutations per pixel); default if no limit is "
             "given: the scene's sample_count",
             "N");
    add_text(app, "--iterations", options.iterations,
             "Stop after N iterations of one sample per pixel (Markov chains: rounds of one segment of each "
             "chain)",
             "N");
    add_text(app, "--time", options.time, "Stop after this time, such as 90s, 10m or 1h30m", "DURATION");
    add_text(app, "--until", options.until,
             "Stop when the upper end of the estimated error is at most X; the first limit that is reached "
             "ends the job",
             "relmse=X");
    add_text(app, "--indices", options.indices,
             "Render exactly these iterations of each half, such as 0-31/0-29 (Markov chains: segments); "
             "`candela reproduce` prints those of an image",
             "A/B");
  }
  add_text(app, "--seed", options.seed, "Seed; default: that of the scene's sampler, else 0", "N");
  add_text(app, "--size", options.size,
           "Size of the image in pixels; default: the scene's film, or its crop window", "WxH");
  add_text(app, "--crop", options.crop,
           "Render this part of the image alone: left, top, width and height in pixels of the whole image",
           "X,Y,W,H");
  add_text(app, "--filter", options.filter,
           "Pixel filter: box, tent, gaussian, mitchell, catmullrom or lanczos; default: the scene's rfilter",
           "NAME");
  add_text(app, "--sampler", options.sampler, "Sampler: sobol (default) or independent", "NAME");
  add_text(app, "--aov", options.aov,
           "AOVs to add as layers, such as albedo,normal,depth or NAME:KIND; none: no AOVs; default: those "
           "of the scene's integrator `aov`",
           "LIST");
  if (with_layers)
    add_texts(
        app, "--layer", options.layers,
        "Add a layer of the light whose paths match a light path expression, such as caustics=LS+DE; may be "
        "repeated; none: no layers; default: those of the scene's integrator `lpe`",
        "NAME=EXPR");
  add_texts(app, "--region", options.regions,
            "Name a region for @NAME in expressions: NAME=box:x0,y0,z0,x1,y1,z1 or NAME=sphere:x,y,z,radius; "
            "may be repeated",
            "REGION");
  add_text(app, "--glossy-below", options.glossy_below,
           "Roughness alpha below which light that is not mirrored counts as G, above as D (default 0.3)",
           "ALPHA");
  if (with_layers) {
    app.add_flag("--light-groups", options.light_groups, "Add a layer light.NAME for each lamp");
    app.add_flag("--partition", options.partition,
                 "Require that each path matches exactly one layer, so that the layers add up to the image");
  }
  add_text(app, "--edits", options.edits,
           "Edit how light travels at chosen surfaces, by a file of JSON; none: no edits; default: those of "
           "the scene's integrator `edits`",
           "FILE");
  add_scene_memory(app, options);
  add_text(app, "--isa", options.isa,
           "Instruction set that Embree may use: sse2, sse4.2, avx, avx2 (default) or avx512; the pixels "
           "depend on it",
           "NAME");
}

}  // namespace

void add_scene_options(CLI::App& app, SceneOptions& options, bool with_limits) {
  add_scene_file(app, options);
  add_job_options(app, options, with_limits, true);
}

void add_options_without_layers(CLI::App& app, SceneOptions& options) {
  add_defines(app, options);
  add_job_options(app, options, true, false);
}

void add_farm_options(CLI::App& app, FarmOptions& options) {
  add_text(app, "--master", options.master,
           "Address of the master; default: $CANDELA_MASTER, else the configuration", "HOST:PORT");
  add_text(app, "--tls-cert", options.tls_cert, "Certificate of this client (PEM); $CANDELA_TLS_CERT",
           "FILE");
  add_text(app, "--tls-key", options.tls_key, "Private key of that certificate (PEM); $CANDELA_TLS_KEY",
           "FILE");
  add_text(app, "--tls-ca", options.tls_ca,
           "Certificate of the authority that signed the master's certificate (PEM); $CANDELA_TLS_CA",
           "FILE");
  add_text(app, "--token-file", options.token_file,
           "File with the token of a master without TLS; default: $CANDELA_TOKEN_FILE, else that of this "
           "user's master",
           "FILE");
  app.add_flag("--insecure", options.insecure,
               "Talk without TLS to a master on another machine; $CANDELA_INSECURE=true");
  add_text(app, "--timeout", options.timeout,
           "Give up if the master cannot be reached for this long (default 10s); $CANDELA_TIMEOUT",
           "DURATION");
}

void warn_of_scene(std::ostream& err, const LoadedScene& scene) {
  constexpr std::size_t most_lines = 20;
  const auto place = [&](const description::Location& where) {
    const auto file = scene.gathered.real_paths.find(where.file);
    return fmt::format(
        "{}:{}", printable(file == scene.gathered.real_paths.end() ? where.file : file->second.string()),
        where.line);
  };
  if (const auto& other = scene.job.other_integrator)
    err << fmt::format("candela: note: {}: {}\n", place(other->where), other->text);
  if (const auto& chosen = scene.job.default_integrator)
    err << fmt::format("candela: warning: {}: {}\n", place(chosen->where), chosen->text);
  // Ignored parameters are among the differences; a finding of many objects is printed once.
  std::vector<description::Finding> findings = description::review(scene.gathered.description).findings;
  std::erase_if(findings, [](const description::Finding& finding) { return !is_warning(finding.kind); });
  for (std::size_t i = 0; i < findings.size() && i < most_lines; ++i) {
    const description::Finding& finding = findings[i];
    err << fmt::format(
        "candela: warning: {}: {}{}\n", place(finding.where), printable(finding.text),
        finding.count > 1 ? fmt::format(" (and {} more like it)", finding.count - 1) : std::string());
  }
  if (findings.size() > most_lines)
    err << fmt::format("candela: warning: {} more warnings; see them all by: candela check\n",
                       findings.size() - most_lines);
}

Result<ConnectionOptions> resolve_connection(const FarmOptions& options, const Config& config) {
  CANDELA_TRY(config.check_shared());
  CANDELA_TRY(config.check_section(
      "client", {"master", "tls-cert", "tls-key", "tls-ca", "token-file", "insecure", "timeout"}));
  // The plain key first: that is also the environment's short name.
  const auto key_of = [&](const std::string& name) { return config.get(name) ? name : "client." + name; };
  const auto choose = [&](const std::optional<std::string>& option, const std::string& name) {
    return option ? *option : config.get(key_of(name)).value_or("");
  };
  ConnectionOptions connection;
  connection.master = choose(options.master, "master");
  if (connection.master.empty())
    return usage_error("no master is given").with_mend("use --master HOST:PORT or set $CANDELA_MASTER");
  connection.tls_cert = choose(options.tls_cert, "tls-cert");
  connection.tls_key = choose(options.tls_key, "tls-key");
  connection.tls_ca = choose(options.tls_ca, "tls-ca");
  connection.token_file = choose(options.token_file, "token-file");
  connection.insecure = options.insecure;
  if (const auto text = config.get(key_of("insecure")); text && !connection.insecure) {
    if (*text != "true" && *text != "false" && *text != "1" && *text != "0")
      return usage_error(fmt::format("'{}' is neither true nor false", printable(*text)))
          .with_field(config.origin(key_of("insecure")));
    connection.insecure = *text == "true" || *text == "1";
  }
  if (const std::string text = choose(options.timeout, "timeout"); !text.empty()) {
    const std::string origin = options.timeout ? "--timeout" : config.origin(key_of("timeout"));
    CANDELA_ASSIGN(connection.timeout_seconds, parse_duration(text, origin));
  }
  return connection;
}

Result<std::unique_ptr<FarmClient>> connect(const FarmOptions& options) {
  CANDELA_ASSIGN(const Config config, Config::load());
  CANDELA_ASSIGN(const ConnectionOptions connection, resolve_connection(options, config));
  CANDELA_ASSIGN(std::unique_ptr<FarmClient> client, FarmClient::create(connection));
  CANDELA_TRY(client->check_server());
  return client;
}

int exit_code_of(const v1::JobStatus& status) {
  return status.state() == v1::JOB_STATE_DONE ? 0 : 1;
}

}  // namespace candela::client
