// candela watch and fetch: seeing a job to its end, and getting its image at any time.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "client/commands/commands.h"
#include "client/commands/waiting.h"
#include "client/values.h"

namespace candela::client {
namespace {

struct WatchOptions {
  FarmOptions farm;
  std::string id, output;
  std::optional<std::string> png, estimator, half;
  PreviewOptions preview;
  bool quiet = false, json = false, error_layer = false, chain_layers = false, partial = false,
       layers = false, variance_layer = false;
};

Result<int> run_watch(Context& context, const WatchOptions& options) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  return wait_for_job(context, *farm, options.id, {options.quiet, options.json, false, {}, options.preview});
}

Result<int> run_fetch(const WatchOptions& options) {
  const ImageOutput output{options.output, options.png.value_or("")};
  if (output.exr.empty() && output.png.empty())
    return usage_error("no output is given").with_mend("use -o out.exr, --png out.png or both");
  CANDELA_TRY(check_output(output));
  CANDELA_ASSIGN(const auto half, parse_half(options.half, options.error_layer, options.variance_layer));
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(
      const std::string exr,
      farm->fetch_image(options.id,
                        {options.error_layer, output.exr.empty(), options.chain_layers, options.partial,
                         options.layers, options.estimator.value_or(""), half, options.variance_layer}));
  CANDELA_TRY(write_images(output, exr));
  return 0;
}

}  // namespace

void add_watch(CLI::App& app, Context& context) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App* sub =
      app.add_subcommand("watch", "Show a job's progress until it has ended; exits with its result");
  sub->add_option("id", options->id, "The job")->required()->type_name("ID");
  add_farm_options(*sub, options->farm);
  add_preview_options(*sub, options->preview, false);
  sub->add_flag("--quiet", options->quiet, "Print no progress, only wait");
  sub->add_flag("--json", options->json, "Print the last status as JSON");
  sub->callback([&context, options] {
    context.command = [&context, options] { return run_watch(context, *options); };
  });
}

void add_fetch(CLI::App& app, Context& context) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App* sub = app.add_subcommand("fetch", "Get the image of all samples that are merged so far");
  sub->add_option("id", options->id, "The job")->required()->type_name("ID");
  sub->add_option("-o,--output", options->output, "Write the image here (.exr)")->type_name("FILE");
  add_text(*sub, "--png", options->png, "Write the image as sRGB PNG", "FILE");
  sub->add_flag("--error-layer", options->error_layer,
                "Add the layer 'error': the estimated standard deviation");
  sub->add_flag("--variance-layer", options->variance_layer,
                "Add the layer 'variance': the estimated variance, without bias");
  sub->add_flag("--chain-layers", options->chain_layers,
                "Markov chains: add the parts that make up the image, as layers 'raw.chains' and 'raw.*'");
  sub->add_flag("--layers", options->layers,
                "Add the layers of adaptive radii, such as 'radius', to the EXR (fppm, cppm, appm, vcmplus)");
  add_text(*sub, "--estimator", options->estimator,
           "optimis: estimator that makes the image from the merged sums; default: its setting `estimator`",
           "NAME");
  add_text(*sub, "--half", options->half,
           "Write the image of one half of the samples, for denoisers that filter each half by the other",
           "A|B");
  sub->add_flag("--partial", options->partial,
                "Get what is left of a job that has ended and has lost samples (see verify)");
  add_farm_options(*sub, options->farm);
  sub->callback([&context, options] { context.command = [options] { return run_fetch(*options); }; });
}

}  // namespace candela::client
