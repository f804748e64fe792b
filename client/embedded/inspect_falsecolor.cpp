// candela inspect falsecolor: an image's numbers as colors, with a scale.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <memory>
#include <ostream>

#include "client/context.h"
#include "client/embedded/commands.h"
#include "client/embedded/falsecolor_source.h"
#include "client/output.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/false_color.h"
#include "common/image/quantity.h"
#include "common/wire/json_values.h"

namespace candela::client {
namespace {

struct FalseColorOptions {
  FalseColorSource source;
  std::string output;
  std::vector<const CLI::Option*> of_scene;  // that an image has no use for
  std::optional<std::string> channel, minus, map, range, percentiles;
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
  CANDELA_TRY(set_if_given(choice.percentiles, options.percentiles, "--percentiles", parse_interval, 0, 100));
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

// Refuses options of a scene if there is none.
Result<void> check_options_of_scene(const FalseColorOptions& options) {
  if (is_scene(options.source)) return {};
  for (const CLI::Option* option : options.of_scene)
    if (option->count() > 0)
      return usage_error(fmt::format("{} is no scene, and is not rendered", printable(options.source.input)))
          .with_field("--" + option->get_lnames().back())
          .with_mend("leave it out, or give a scene");
  return {};
}

// The quantity of an EXR. shown: its name in errors.
Result<image::Quantity> read(const FalseColorOptions& options, const std::string& file,
                             const std::string& shown) {
  const FalseColorSource& source = options.source;
  const std::string channel = options.channel.value_or("");
  std::string layer = source.layer.value_or("");
  if (source.select) {
    CANDELA_ASSIGN(layer, layer_of_expression(file, shown, *source.select));
  }
  auto found = image::read_quantity(file, layer, channel);
  if (!found.ok()) {
    Error error = std::move(found).error();
    return error.file == file ? std::move(error).at(shown, 0) : std::move(error);
  }
  image::Quantity quantity = *std::move(found);
  if (source.select) quantity.name = *source.select + quantity.name.substr(layer.size());
  return quantity;
}

// file: the EXR, or what was made of the input.
Result<image::Quantity> read_difference(const FalseColorOptions& options, const std::string& file) {
  const std::string& input = options.source.input;
  CANDELA_ASSIGN(image::Quantity quantity, read(options, file, input));
  if (!options.minus) return quantity;
  CANDELA_ASSIGN(const image::Quantity other, read(options, *options.minus, *options.minus));
  if (quantity.width != other.width || quantity.height != other.height)
    return input_error(fmt::format("{} is {}x{} but {} is {}x{}", printable(input), quantity.width,
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
  const FalseColorSource& source = options.source;
  if (source.layer && source.layer->empty()) return usage_error("no layer is named").with_field("--layer");
  if (options.channel && options.channel->empty())
    return usage_error("no channel is named").with_field("--channel");
  CANDELA_TRY(check_select(source));
  CANDELA_TRY(check_options_of_scene(options));
  CANDELA_ASSIGN(const SourceFile file, source_file(context, source));
  if (file.code != 0) return file.code;
  CANDELA_ASSIGN(const image::Quantity quantity, read_difference(options, file.path));
  image::ColorScale scale;
  if (choice.range) {
    scale = {choice.range->low, choice.range->high, options.logarithmic};
  } else {
    auto found = image::percentile_scale(quantity.values, choice.percentiles.low, choice.percentiles.high,
                                         options.logarithmic, options.is_signed);
    if (!found.ok()) return std::move(found).error().at(source.input, 0).with_mend("give --range LOW,HIGH");
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

void add_inspect_falsecolor(CLI::App& inspect, Context& context) {
  auto options = std::make_shared<FalseColorOptions>();
  FalseColorSource& source = options->source;
  CLI::App* sub = inspect.add_subcommand("falsecolor",
                                         "Show the luminance or a layer of an EXR, a scene or a farm's job "
                                         "through a color map, with a scale, as "
                                         "a PNG");
  sub->add_option(
         "image", source.input,
         "An EXR, a scene (.xml, .pbrt) to render, or with --master a job's id, its beginning, or its "
         "name; of an EXR or job --select takes the layer of that expression")
      ->required()
      ->type_name("IN");
  const std::size_t before = sub->get_options().size();
  add_options_without_layers(*sub, source.scene);
  add_text(*sub, "--threads", source.threads, "Threads; default: one for each core", "N");
  const auto with_scene = sub->get_options();
  options->of_scene.assign(with_scene.begin() + static_cast<std::ptrdiff_t>(before), with_scene.end());
  add_text(*sub, "--select", source.select,
           "Take only light whose paths match this light path expression, such as LS+DE", "EXPR");
  sub->add_option("-o,--output", options->output, "The PNG to write")->required()->type_name("OUT");
  add_text(*sub, "--layer", source.layer,
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
  sub->add_flag("--quiet", source.quiet, "Print no progress");
  sub->add_flag("--json", options->json, "Print JSON");
  add_farm_options(*sub, source.farm);
  set_command(*sub, context, run_falsecolor, options);
}

}  // namespace candela::client
