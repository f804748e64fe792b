// candela compare and convert: images without a farm.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/json.h"
#include "client/output.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/image.h"

namespace candela::client {
namespace {

struct ImageOptions {
  std::string a, b;
  std::optional<std::string> exposure, worst, layer;
  bool json = false;
};

Result<int> run_compare(Context& context, const ImageOptions& options) {
  std::uint64_t worst = 5;
  if (options.worst) {
    CANDELA_ASSIGN(worst, parse_count(*options.worst, "--worst", 0, 1000));
  }
  CANDELA_ASSIGN(const image::Image a, image::read_image(options.a));
  CANDELA_ASSIGN(const image::Image b, image::read_image(options.b));
  if (a.width != b.width || a.height != b.height)
    return input_error(fmt::format("{} is {}x{} but {} is {}x{}", printable(options.a), a.width, a.height,
                                   printable(options.b), b.width, b.height))
        .with_mend("compare images of one size");
  const stats::ImageComparison c = stats::compare(a.rgb, b.rgb, a.width, a.height, worst);
  if (options.json) {
    context.out << comparison_json(c) << '\n';
    return 0;
  }
  context.out << fmt::format(
      "mean        {:.6g} (reference {:.6g})\nmean ratio  {:.6f}\nRMSE        {:.6g}\nrelMSE      {:.6g}\n",
      c.mean_a, c.mean_b, c.mean_ratio, c.rmse, c.relmse);
  context.out << fmt::format("relMSE without the worst 0.1 % of pixels  {:.6g}\n", c.relmse_trimmed);
  if (!c.worst.empty()) context.out << "worst pixels (x, y: relative squared error; value / reference)\n";
  for (const auto& p : c.worst)
    context.out << fmt::format("  {}, {}: {:.4g}; {:.5g} {:.5g} {:.5g} / {:.5g} {:.5g} {:.5g}\n", p.x, p.y,
                               p.relative_squared_error, p.a[0], p.a[1], p.a[2], p.b[0], p.b[1], p.b[2]);
  return 0;
}

Result<int> run_convert(const ImageOptions& options) {
  double exposure = 0;
  if (options.exposure) {
    CANDELA_ASSIGN(exposure, parse_number(*options.exposure, "--exposure", -100, 100));
  }
  CANDELA_TRY(check_output_path(options.b, ".png", "output"));
  CANDELA_ASSIGN(const image::Image image,
                 options.layer ? image::read_layer(options.a, *options.layer) : image::read_image(options.a));
  CANDELA_ASSIGN(const std::string png, image::encode_png(image, exposure));
  CANDELA_TRY(write_file_atomically(options.b, png));
  return 0;
}

}  // namespace

void add_compare(CLI::App& app, Context& context) {
  auto options = std::make_shared<ImageOptions>();
  CLI::App* sub = app.add_subcommand(
      "compare",
      "Compare an image with a reference: mean ratio, RMSE, relMSE = mean((a-b)^2 / (b^2 + 0.01 mean(b)^2))");
  sub->add_option("image", options->a, "The image")->required()->type_name("A");
  sub->add_option("reference", options->b, "The reference")->required()->type_name("REFERENCE");
  add_text(*sub, "--worst", options->worst, "How many of the worst pixels to print (default 5)", "N");
  sub->add_flag("--json", options->json, "Print JSON");
  sub->callback([&context, options] {
    context.command = [&context, options] { return run_compare(context, *options); };
  });
}

void add_convert(CLI::App& app, Context& context) {
  auto options = std::make_shared<ImageOptions>();
  CLI::App* sub = app.add_subcommand("convert", "Convert an image to an 8-bit sRGB PNG");
  sub->add_option("input", options->a, "The image")->required()->type_name("IN");
  sub->add_option("output", options->b, "The PNG to write")->required()->type_name("OUT");
  add_text(*sub, "--layer", options->layer, "Show this layer of the EXR in place of the image", "NAME");
  add_text(*sub, "--exposure", options->exposure, "Multiply by 2^E first (default 0)", "E");
  sub->callback([&context, options] { context.command = [options] { return run_convert(*options); }; });
}

}  // namespace candela::client
