// candela convert: images without a farm.
#include <CLI/CLI.hpp>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/output.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/image.h"

namespace candela::client {
namespace {

struct ImageOptions {
  std::string a, b;
  std::optional<std::string> exposure, layer;
};

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
