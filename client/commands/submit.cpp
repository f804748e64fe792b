// candela submit: a scene becomes a job on a farm; its id alone goes to standard output.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <ostream>

#include "client/commands/commands.h"
#include "client/commands/waiting.h"
#include "client/json.h"
#include "client/submission.h"
#include "client/values.h"

namespace candela::client {
namespace {

struct SubmitOptions {
  SceneOptions scene;
  FarmOptions farm;
  std::optional<std::string> name, priority, share, token, output, png;
  PreviewOptions preview;
  bool wait = false, quiet = false, json = false, error_layer = false, variance_layer = false;
};

// Refuses options that need --wait if --wait is not given.
Result<void> check_waits(const SubmitOptions& options) {
  if (options.wait) return {};
  const std::pair<bool, const char*> needs[] = {
      {options.output.has_value(), "--output"},   {options.png.has_value(), "--png"},
      {options.error_layer, "--error-layer"},     {options.variance_layer, "--variance-layer"},
      {options.preview.tev.has_value(), "--tev"}, {options.preview.interval.has_value(), "--preview"},
  };
  for (const auto& [given, option] : needs)
    if (given) return usage_error("an output needs --wait").with_field(option);
  return {};
}

Result<int> run_submit(Context& context, const SubmitOptions& options) {
  WaitOptions wait{options.quiet,       options.json,
                   options.error_layer, {options.output.value_or(""), options.png.value_or("")},
                   options.preview,     options.variance_layer};
  CANDELA_TRY(check_waits(options));
  CANDELA_TRY(check_output(wait.output));
  // A bad address or interval is told before there is a job.
  CANDELA_TRY(plan_preview(options.preview, {}, wait.output.png));
  Submission submission;
  submission.name = options.name.value_or(std::filesystem::path(options.scene.scene).filename().string());
  if (submission.name.size() > Limits::max_name_bytes)
    return usage_error(fmt::format("the name is longer than {} bytes", Limits::max_name_bytes))
        .with_field("--name");
  submission.token = options.token.value_or("");
  if (options.token && (options.token->empty() || options.token->size() > Limits::max_name_bytes))
    return usage_error(fmt::format("a token has 1 to {} bytes", Limits::max_name_bytes))
        .with_field("--token");
  if (options.priority) {
    CANDELA_ASSIGN(const std::int64_t priority,
                   parse_integer(*options.priority, "--priority", -1000000, 1000000));
    submission.priority = static_cast<std::int32_t>(priority);
  }
  if (options.share) {
    CANDELA_ASSIGN(submission.share, parse_number(*options.share, "--share", 1e-3, 1e6));
  }
  CANDELA_ASSIGN(const LoadedScene scene, load_scene(options.scene, context.facts));
  warn_of_scene(context.err, scene);
  CANDELA_ASSIGN(const std::unique_ptr<FarmClient> farm, connect(options.farm));
  Submitted submitted;
  {
    ProgressLine progress(context.err, ProgressLine::mode_for(options.quiet));
    CANDELA_ASSIGN(submitted, submit_scene(*farm, scene, context.facts, submission, progress));
  }
  if (!options.json)
    context.out << printable(submitted.job_id) << '\n' << std::flush;
  else if (!options.wait)
    context.out << submitted_json(submitted.job_id, submitted.existed, submitted.uploaded_bytes) << '\n';
  if (!options.wait) return 0;
  return wait_for_job(context, *farm, submitted.job_id, wait);
}

}  // namespace

void add_submit(CLI::App& app, Context& context) {
  auto options = std::make_shared<SubmitOptions>();
  CLI::App* sub = app.add_subcommand("submit", "Send a scene to a farm as a job; prints the job's id");
  add_scene_options(*sub, options->scene, true);
  add_farm_options(*sub, options->farm);
  add_text(*sub, "--name", options->name, "Name of the job for people; default: the scene's file name",
           "TEXT");
  add_text(*sub, "--priority", options->priority, "Higher runs first (default 0)", "N");
  add_text(*sub, "--share", options->share, "Weight among jobs of one priority (default 1)", "X");
  add_text(*sub, "--token", options->token,
           "Idempotency token: submitting again with it returns the first job", "TEXT");
  sub->add_flag("--wait", options->wait, "Show progress until the job has ended, and exit with its result");
  add_text(*sub, "-o,--output", options->output, "With --wait: write the image here at the end (.exr)",
           "FILE");
  add_text(*sub, "--png", options->png, "With --wait: also write the image as sRGB PNG", "FILE");
  add_preview_options(*sub, options->preview, true);
  sub->add_flag("--error-layer", options->error_layer, "With --wait: add the layer 'error' to the EXR");
  sub->add_flag("--variance-layer", options->variance_layer,
                "With --wait: add the layer 'variance' to the EXR");
  sub->add_flag("--quiet", options->quiet, "Print no progress");
  sub->add_flag("--json", options->json, "Print JSON: with --wait the job's last status, else its id");
  sub->callback([&context, options] {
    context.command = [&context, options] { return run_submit(context, *options); };
  });
}

}  // namespace candela::client
