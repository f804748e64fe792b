// candela watch and fetch: seeing a job to its end, and getting its image at any time.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "client/commands/commands.h"
#include "client/commands/image_options.h"
#include "client/commands/waiting.h"
#include "client/commands/watch_many.h"
#include "client/jobs_of_words.h"
#include "client/values.h"
#include "common/image/denoise.h"

namespace candela::client {
namespace {

struct WatchOptions {
  FarmOptions farm;
  std::vector<std::string> ids;
  std::optional<std::string> output, png, on_end, mix;
  ImageOptions image;
  PreviewOptions preview;
  bool quiet = false, json = false;
};

Result<int> run_watch(Context& context, const WatchOptions& options) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const std::vector<v1::JobName> jobs, jobs_of_words(*farm, options.ids));
  if (jobs.size() == 1 && !jobs.front().group())
    return wait_for_job(context, *farm, jobs.front().id(),
                        {.quiet = options.quiet,
                         .json = options.json,
                         .preview = options.preview,
                         .on_end = options.on_end.value_or("")});
  if (options.preview.tev)
    return usage_error("the viewer shows one job").with_field("--tev").with_mend("watch one job");
  std::vector<EndedJob> ended;
  CANDELA_ASSIGN(const int code, wait_for_jobs(context, *farm, jobs, options.quiet, options.json, ended));
  const int on_end = run_on_end(context, options.on_end.value_or(""), ended);
  return code != 0 ? code : on_end;
}

Result<int> run_fetch(Context& context, const WatchOptions& options) {
  CANDELA_ASSIGN(const ImageRequest request, request_of(options.image));
  // Options are checked before the farm is asked.
  if (options.output.value_or("").find('{') == std::string::npos &&
      options.png.value_or("").find('{') == std::string::npos) {
    CANDELA_ASSIGN(const ImageOutput output, outputs_of(options.output, options.png, ""));
    CANDELA_TRY(check_output(output));
  }
  if (options.image.denoise) CANDELA_TRY(image::Denoiser::load());
  std::optional<image::Mix> mix;
  if (options.mix) {
    for (const auto& [given, option] : {std::pair<bool, const char*>{request.error_layer, "--error-layer"},
                                        {request.variance_layer, "--variance-layer"}})
      if (given)
        return usage_error("the error is estimated of the image before the mix, and is not that of the mix")
            .with_field(option)
            .with_mend(fmt::format("leave out {} or --mix", option));
    CANDELA_ASSIGN(mix, image::read_mix(*options.mix));
  }
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const std::vector<v1::JobName> jobs, jobs_of_words(*farm, options.ids));
  return fetch_jobs(context, *farm, jobs,
                    {options.output, options.png, request, false, options.image.denoise, std::move(mix)});
}

}  // namespace

void add_watch(CLI::App& app, Context& context) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App* sub =
      app.add_subcommand("watch", "Show the progress of jobs until they have ended; exits with their result");
  add_job_words(*sub, options->ids, "The jobs or groups: ids, their beginnings, or names");
  add_farm_options(*sub, options->farm);
  add_preview_options(*sub, options->preview, false);
  sub->add_flag("--quiet", options->quiet, "Print no progress, only wait");
  sub->add_flag("--json", options->json, "Print the last status as JSON");
  add_on_end(*sub, options->on_end);
  set_command(*sub, context, run_watch, options);
}

void add_fetch(CLI::App& app, Context& context) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App* sub = app.add_subcommand("fetch", "Get the image of the merged samples, at any time");
  add_job_words(*sub, options->ids, "The jobs or groups: ids, their beginnings, or names");
  add_text(*sub, "-o,--output", options->output,
           "Write the image here: an .exr, or a .png without layers and metadata; {name}, {id}, {frame} and "
           "{frame:4} (zeros in front) are those of the job; default: the job's name and .exr",
           "FILE");
  add_text(*sub, "--png", options->png, "Write the image as sRGB PNG", "FILE");
  add_image_options(*sub, options->image);
  add_text(*sub, "--mix", options->mix, kMixText, "FILE.json");
  sub->add_flag("--partial", options->image.request.partial,
                "Get the image of an ended job that has lost samples (see verify)");
  add_farm_options(*sub, options->farm);
  set_command(*sub, context, run_fetch, options);
}

}  // namespace candela::client
