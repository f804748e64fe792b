// candela inspect falsecolor: an image's numbers as colors, with a scale.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <memory>
#include <ostream>

#include "client/commands/inspect_tools.h"
#include "client/context.h"
#include "client/farm_client.h"
#include "client/jobs_of_words.h"
#include "client/output.h"
#include "client/passing_folder.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/false_color.h"
#include "common/image/quantity.h"
#include "common/wire/json_values.h"

namespace candela::client {
namespace {

struct FalseColorOptions {
  std::string image, output;  // image: a job, if the farm has a master
  FarmOptions farm;
  std::optional<std::string> layer, channel, minus, map, range, percentiles;
  bool logarithmic = false, is_signed = false, json = false;
};

// All that the options say, checked before a file is read.
struct Choice {
  image::ColorMap map = image::ColorMap::viridis;
  std::optional<Interval> range;
  Interval percentiles = {1, 99};
};

Result<Choice> choose(const FalseColorOptions& options) {
  Choice choice;
  if (options.map) {
    CANDELA_ASSIGN(const std::string name, parse_choice(*options.map, "--map", image::kColorMapNames));
    choice.map = *image::color_map_of(name);
  }
  if (options.is_signed && options.map)
    return usage_error("--signed has a map of its own")
        .with_field("--map")
        .with_mend("leave one of them out");
  if (options.is_signed && options.logarithmic)
    return usage_error("--log and --signed exclude each other").with_field("--log");
  if (options.is_signed) choice.map = image::ColorMap::cool_warm;
  if (options.range && options.percentiles)
    return usage_error("--range and --percentiles exclude each other").with_field("--percentiles");
  if (options.percentiles) {
    CANDELA_ASSIGN(choice.percentiles, parse_interval(*options.percentiles, "--percentiles", 0, 100));
  }
  if (options.range) {
    constexpr double most = std::numeric_limits<float>::max();
    CANDELA_ASSIGN(choice.range, parse_interval(*options.range, "--range", -most, most));
    if (options.logarithmic && !(choice.range->low > 0))
      return usage_error("a logarithmic range begins above 0").with_field("--range");
    if (options.is_signed && choice.range->low != -choice.range->high)
      return usage_error("the range of --signed is not symmetric about 0")
          .with_field("--range")
          .with_mend(fmt::format("such as --range -{0:.6g},{0:.6g}",
                                 std::max(-choice.range->low, choice.range->high)));
  }
  return choice;
}

// The image of a job so far, with the layer that is asked for.
Result<void> fetch_job(const FalseColorOptions& options, const std::string& file) {
  CANDELA_ASSIGN(const auto farm, connect(options.farm));
  CANDELA_ASSIGN(const v1::JobName job, job_of_word(*farm, options.image));
  ImageRequest request;
  request.error_layer = options.layer == "error";
  request.variance_layer = options.layer == "variance";
  CANDELA_ASSIGN(const std::string exr, farm->fetch_image(job.id(), request));
  return write_file_atomically(file, exr);
}

// file: the EXR.
Result<image::Quantity> read(const FalseColorOptions& options, const std::string& file) {
  const std::string layer = options.layer.value_or(""), channel = options.channel.value_or("");
  if (options.layer && layer.empty()) return usage_error("no layer is named").with_field("--layer");
  if (options.channel && channel.empty()) return usage_error("no channel is named").with_field("--channel");
  auto found = image::read_quantity(file, layer, channel);
  if (!found.ok()) {
    Error error = std::move(found).error();
    return error.file == file ? std::move(error).at(options.image, 0) : std::move(error);
  }
  image::Quantity quantity = *std::move(found);
  if (!options.minus) return quantity;
  CANDELA_ASSIGN(const image::Quantity other, image::read_quantity(*options.minus, layer, channel));
  if (quantity.width != other.width || quantity.height != other.height)
    return input_error(fmt::format("{} is {}x{} but {} is {}x{}", printable(options.image), quantity.width,
                                   quantity.height, printable(*options.minus), other.width, other.height))
        .with_mend("subtract an image of the same size");
  for (std::size_t i = 0; i < quantity.values.size(); ++i) quantity.values[i] -= other.values[i];
  quantity.name += ", difference";
  return quantity;
}

std::string summary_json(const FalseColorOptions& options, const image::Quantity& quantity,
                         const image::ColorScale& scale, const image::ValueSummary& s) {
  return wire::json_text(
      {{"quantity", quantity.name},
       {"map", options.is_signed ? "signed" : options.map.value_or("viridis")},
       {"logarithmic", options.logarithmic},
       {"range", {scale.low, scale.high}},
       {"minimum", wire::finite(s.minimum)},
       {"maximum", wire::finite(s.maximum)},
       {"mean", wire::finite(s.mean)},
       {"pixels", s.pixels},
       {"not_finite", s.not_finite},
       {"zero_or_less", options.logarithmic ? wire::Json(s.not_positive) : wire::Json(nullptr)},
       {"below", s.below},
       {"above", s.above}});
}

std::string summary_line(const FalseColorOptions& options, const image::Quantity& quantity,
                         const image::ColorScale& scale, const image::ValueSummary& s) {
  std::string line = fmt::format(
      "{}: range {:.4g} to {:.4g}{}; minimum {:.4g}, maximum {:.4g}, mean {:.4g}; of {} pixels {} below and "
      "{} "
      "above the range, {} not finite",
      printable(quantity.name), scale.low, scale.high, options.logarithmic ? ", logarithmic" : "", s.minimum,
      s.maximum, s.mean, s.pixels, s.below, s.above, s.not_finite);
  if (options.logarithmic) line += fmt::format(", {} zero or less", s.not_positive);
  return line;
}

Result<int> run_falsecolor(Context& context, const FalseColorOptions& options) {
  CANDELA_ASSIGN(const Choice choice, choose(options));
  CANDELA_TRY(check_output_path(options.output, ".png", "--output"));
  PassingFolder folder;
  std::string file = options.image;
  if (options.farm.master) {
    CANDELA_ASSIGN(folder, PassingFolder::make());
    file = (folder.path() / "job.exr").string();
    CANDELA_TRY(fetch_job(options, file));
  }
  CANDELA_ASSIGN(const image::Quantity quantity, read(options, file));
  image::ColorScale scale;
  if (choice.range) {
    scale = {choice.range->low, choice.range->high, options.logarithmic};
  } else {
    auto found = image::percentile_scale(quantity.values, choice.percentiles.low, choice.percentiles.high,
                                         options.logarithmic, options.is_signed);
    if (!found.ok()) return std::move(found).error().at(options.image, 0).with_mend("give --range LOW,HIGH");
    scale = *found;
  }
  const image::ValueSummary summary = image::summarize(quantity.values, scale);
  const image::Figure figure = image::draw_false_color(quantity.values, quantity.width, quantity.height,
                                                       choice.map, scale, summary, quantity.name);
  CANDELA_ASSIGN(const std::string png, image::encode_png(figure.canvas));
  CANDELA_TRY(write_file_atomically(options.output, png));
  const auto text = options.json ? summary_json : summary_line;
  context.out << text(options, quantity, scale, summary) << '\n';
  return 0;
}

}  // namespace

void add_falsecolor(CLI::App& inspect, Context& context) {
  auto options = std::make_shared<FalseColorOptions>();
  CLI::App* sub =
      inspect.add_subcommand("falsecolor",
                             "Show the luminance or a layer of an EXR, or with --master of a job of a farm, "
                             "through a color map, with a scale, as a PNG");
  sub->add_option("image", options->image, "The EXR; with --master: the job's id, its beginning, or its name")
      ->required()
      ->type_name("IN");
  sub->add_option("-o,--output", options->output, "The PNG to write")->required()->type_name("OUT");
  add_text(*sub, "--layer", options->layer,
           "Show this layer in place of the image, such as error, irradiance or an AOV", "NAME");
  add_text(*sub, "--channel", options->channel,
           "Channel: R, G, B, X, Y, Z, U, V, I, luminance or length (of a vector); default: the only "
           "channel, else luminance, else length",
           "CHANNEL");
  add_text(*sub, "--minus", options->minus, "Subtract the same quantity of this EXR first", "FILE");
  add_text(*sub, "--map", options->map, "Color map: viridis (default), turbo, grey or heat", "MAP");
  sub->add_flag("--log", options->logarithmic,
                "Use a logarithmic scale; values of 0 or less have a color of their own");
  sub->add_flag("--signed", options->is_signed,
                "Use a range symmetric about 0, from blue (below) to red (above)");
  add_text(*sub, "--range", options->range, "Values at the ends of the scale", "LOW,HIGH");
  add_text(*sub, "--percentiles", options->percentiles,
           "Take the range between two percentiles of the values (default 1,99)", "LOW,HIGH");
  sub->add_flag("--json", options->json, "Print JSON");
  add_farm_options(*sub, options->farm);
  set_command(*sub, context, run_falsecolor, options);
}

}  // namespace candela::client
