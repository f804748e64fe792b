// candela convert: images without a farm.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <memory>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/output.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/denoise.h"
#include "common/image/image.h"
#include "common/image/mix.h"
#include "common/image/picture.h"

namespace candela::client {
namespace {

struct ConvertOptions {
  std::string input, output;
  std::optional<std::string> exposure, layer, range, quality, mix;
  bool denoise = false;
};

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 36;

// All that the options say, checked before a file is read. No format: an EXR.
struct ConvertChoice {
  std::optional<image::PictureFormat> format;
  image::Tone tone;
  bool whole = false;  // --range auto
};

Error exclude(const char* a, const char* b) {
  return usage_error(fmt::format("{} and {} exclude each other", a, b)).with_field(a);
}

std::string ending_of(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return ending;
}

Result<ConvertChoice> choose(const ConvertOptions& options) {
  ConvertChoice choice;
  choice.format = image::picture_format_of(options.output);
  const std::string ending = ending_of(options.output);
  if (ending == ".exr" && !options.denoise && !options.mix)
    return usage_error(
               fmt::format("{}: an EXR is made with --denoise or --mix only", printable(options.output)))
        .with_field("output")
        .with_mend("name a .png, .jpg or .tif");
  if (!choice.format && ending != ".exr")
    return usage_error(fmt::format("{}: the name does not end in .png, .jpg or .tif{}",
                                   printable(options.output),
                                   options.denoise || options.mix ? ", or .exr" : ""))
        .with_field("output");
  CANDELA_TRY(check_output_path(options.output, ending, "output"));
  if (options.exposure && options.range) return exclude("--exposure", "--range");
  if (options.denoise && options.layer) return exclude("--layer", "--denoise");
  if (options.mix && options.layer) return exclude("--layer", "--mix");
  if (!choice.format && options.exposure) return exclude("--exposure", "an EXR");
  if (!choice.format && options.range) return exclude("--range", "an EXR");
  if (options.quality && choice.format != image::PictureFormat::jpeg)
    return usage_error("only a JPEG has a quality").with_field("--quality");
  CANDELA_TRY(
      set_if_given(choice.tone.exposure_stops, options.exposure, "--exposure", parse_number, -100, 100));
  if (options.quality) {
    CANDELA_ASSIGN(const std::uint64_t quality, parse_count(*options.quality, "--quality", 1, 100));
    choice.tone.jpeg_quality = static_cast<int>(quality);
  }
  choice.whole = options.range == "auto";
  if (options.range && !choice.whole) {
    constexpr double most = std::numeric_limits<float>::max();
    auto range = parse_interval(*options.range, "--range", -most, most);
    if (!range.ok() && range.error().mend.empty())
      return std::move(range).error().with_mend("give LOW,HIGH, or auto");
    if (!range.ok()) return std::move(range).error();
    choice.tone.range = {range->low, range->high};
  }
  return choice;
}

Result<image::MixedExr> mixed(Context& context, const std::string& path, const std::string& mix_file) {
  CANDELA_ASSIGN(const image::Mix mix, image::read_mix(mix_file));
  CANDELA_ASSIGN(const std::string exr, read_file(path, kMaxFileBytes));
  auto result = image::mix_exr(exr, mix);
  if (!result.ok()) return std::move(result).error().at(path, 0);
  for (const std::string& layer : result->left_out)
    context.err << fmt::format(
        "candela: note: the layer '{}' is that of the image before the mix, and is left out\n",
        printable(layer));
  return result;
}

// `exr`: bytes of the file `path`.
Result<image::DenoisedExr> denoised(Context& context, const std::string& path, const std::string& exr) {
  CANDELA_ASSIGN(const auto denoiser, image::Denoiser::load());
  auto result = image::denoise_exr(exr, *denoiser);
  if (!result.ok()) return std::move(result).error().at(path, 0);
  if (result->guides.empty())
    context.err << "candela: note: there is no layer with the albedo; with --aov albedo,normal of the "
                   "render the denoiser keeps textures and edges\n";
  return result;
}

Result<int> run_convert(Context& context, const ConvertOptions& options) {
  CANDELA_ASSIGN(ConvertChoice choice, choose(options));
  image::Image image;
  std::string exr;
  if (options.mix) {
    CANDELA_ASSIGN(image::MixedExr result, mixed(context, options.input, *options.mix));
    exr = std::move(result.bytes);
    if (!choice.format && !options.denoise) {
      CANDELA_TRY(write_file_atomically(options.output, exr));
      return 0;
    }
  } else if (options.denoise) {
    CANDELA_ASSIGN(exr, read_file(options.input, kMaxFileBytes));
  }
  if (options.denoise) {
    CANDELA_ASSIGN(image::DenoisedExr result, denoised(context, options.input, exr));
    if (!choice.format) {
      CANDELA_TRY(write_file_atomically(options.output, result.bytes));
      return 0;
    }
    image = image::Image{result.width, result.height, std::move(result.rgb), {}};
  } else if (options.mix) {
    CANDELA_ASSIGN(image, image::decode_exr(exr));
  } else {
    CANDELA_ASSIGN(image, options.layer ? image::read_layer(options.input, *options.layer)
                                        : image::read_image(options.input));
  }
  // Layers of other letters are no colors.
  if (choice.whole || (image.letters != "RGB" && !options.exposure && !choice.tone.range)) {
    auto range = image::whole_range(image);
    if (!range.ok()) return std::move(range).error().at(options.input, 0);
    choice.tone.range = *range;
    context.err << fmt::format("candela: the range is {:.6g},{:.6g}\n", range->low, range->high);
  }
  CANDELA_ASSIGN(const std::string bytes, image::encode_picture(image, *choice.format, choice.tone));
  CANDELA_TRY(write_file_atomically(options.output, bytes));
  return 0;
}

}  // namespace

void add_convert(CLI::App& app, Context& context) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* sub = app.add_subcommand(
      "convert", "Convert an image to a PNG or JPEG of 8 bits, or a TIFF of 16 bits, with sRGB's curve");
  sub->add_option("input", options->input, "The image")->required()->type_name("IN");
  sub->add_option("output", options->output,
                  "The .png, .jpg or .tif to write; with --denoise (which adds the layer 'denoised') and "
                  "--mix also an .exr")
      ->required()
      ->type_name("OUT");
  add_text(*sub, "--layer", options->layer, "Show this layer of the EXR in place of the image", "NAME");
  add_text(*sub, "--mix", options->mix, kMixText, "FILE.json");
  add_text(*sub, "--exposure", options->exposure, "Multiply by 2^E first (default 0)", "E");
  add_text(
      *sub, "--range", options->range,
      "Show values from LOW (black) to HIGH (white) in proportion, without sRGB's curve, such as 0,20 for "
      "depth or -1,1 for normals; auto: the range of all values (default for layers other than colors)",
      "LOW,HIGH");
  add_text(*sub, "--quality", options->quality, "Quality of a JPEG, from 1 to 100 (default 95)", "N");
  sub->add_flag(
      "--denoise", options->denoise,
      "Denoise the image by Open Image Denoise (not included), with the AOVs albedo and normal of the EXR");
  set_command(*sub, context, run_convert, options);
}

}  // namespace candela::client
