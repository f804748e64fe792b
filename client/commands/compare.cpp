// candela compare: two images without a farm.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/json.h"
#include "client/output.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/image.h"
#include "common/job/layer_name.h"
#include "common/stats/image_difference.h"

namespace candela::client {
namespace {

struct CompareOptions {
  std::string a, b;
  std::optional<std::string> worst, image;
  bool json = false;
};

// Number of values that are no variance.
std::ptrdiff_t count_invalid(const std::vector<float>& variance) {
  return std::ranges::count_if(variance, [](float v) { return !std::isfinite(v) || v < 0; });
}

// The variance of each value, if the file has it: its layer 'variance', or the squares of its layer 'error'.
// An image of one iteration has such a layer without a number.
std::vector<float> read_variance(const std::string& path) {
  auto layer = image::read_layer(path, std::string(kVarianceLayer));
  if (!layer.ok()) {
    layer = image::read_layer(path, std::string(kErrorLayer));
    if (!layer.ok()) return {};
    for (float& value : layer->rgb) value *= value;
  }
  if (count_invalid(layer->rgb) == std::ssize(layer->rgb)) return {};
  return std::move(layer->rgb);
}

float luminance(const float* rgb) {
  return 0.2126F * rgb[0] + 0.7152F * rgb[1] + 0.0722F * rgb[2];
}

// Red where the image is brighter than the reference, blue where it is darker, black where both are equal;
// full at a difference of the reference's luminance, to which a tenth of its mean adds. Magenta: not finite.
image::Image picture_of(const image::Image& a, const image::Image& b, double mean) {
  image::Image picture{a.width, a.height, std::vector<float>(a.rgb.size(), 0.0F), {}};
  for (std::size_t i = 0; i < a.rgb.size(); i += 3) {
    const double value = luminance(&a.rgb[i]), reference = luminance(&b.rgb[i]);
    const double scale = std::hypot(reference, 0.1 * mean);
    const double relative = value == reference ? 0 : (value - reference) / scale;
    if (!std::isfinite(relative) && !(scale == 0 && std::isfinite(value))) {
      picture.rgb[i] = std::nanf("");
      continue;
    }
    // Steps of one relative size look alike in dark and bright red: the display undoes a power.
    const auto shade = static_cast<float>(std::pow(std::min(1.0, std::fabs(relative)), 1.2));
    picture.rgb[i + (relative > 0 ? 0 : 2)] = shade;
    if (relative < 0) picture.rgb[i + 1] = 0.25F * shade;  // pure blue is dark
  }
  return picture;
}

std::string number(double value, double error, bool known) {
  std::string text = fmt::format("{:.6g}", value);
  if (known && std::isfinite(error)) text += fmt::format(" +- {:.2g}", error);
  return text;
}

// The pixels of chains and of photon maps are correlated, which the variance of single values does not say.
bool correlated(const image::Image& image) {
  const auto found = image.metadata.find("candela:integrator");
  return found != image.metadata.end() && found->second != "path" && found->second != "optimis" &&
         found->second != "bdpt" && found->second != "light";
}

Result<int> run_compare(Context& context, const CompareOptions& options) {
  std::uint64_t worst = 5;
  CANDELA_TRY(set_if_given(worst, options.worst, "--worst", parse_count, 0, 1000));
  if (options.image) CANDELA_TRY(check_output_path(*options.image, ".png", "--image"));
  CANDELA_ASSIGN(const image::Image a, image::read_image(options.a));
  CANDELA_ASSIGN(const image::Image b, image::read_image(options.b));
  if (a.width != b.width || a.height != b.height)
    return input_error(fmt::format("{} is {}x{} but {} is {}x{}", printable(options.a), a.width, a.height,
                                   printable(options.b), b.width, b.height))
        .with_mend("compare images of one size");
  const stats::ImageComparison c = stats::compare(a.rgb, b.rgb, a.width, a.height, worst);
  if (options.image) {
    CANDELA_ASSIGN(const std::string png, image::encode_png(picture_of(a, b, c.mean_b)));
    CANDELA_TRY(write_file_atomically(*options.image, png));
  }
  const std::vector<float> variance_a = read_variance(options.a), variance_b = read_variance(options.b);
  const bool has_a = !variance_a.empty(), has_b = !variance_b.empty(), known = has_a || has_b;
  const stats::ImageDifference d =
      known ? stats::difference(a.rgb, variance_a, b.rgb, variance_b, a.width, a.height)
            : stats::ImageDifference{};
  if (options.json) {
    context.out << comparison_json(c, known ? &d : nullptr, {has_a, count_invalid(variance_a)},
                                   {has_b, count_invalid(variance_b)})
                << '\n';
    return 0;
  }
  context.out << fmt::format(
      "mean        {} (reference {})\nmean ratio  {}\nRMSE        {}\nrelMSE      {}\n",
      number(c.mean_a, d.noise.mean_a, has_a), number(c.mean_b, d.noise.mean_b, has_b),
      known ? number(c.mean_ratio, d.noise.mean_ratio, true) : fmt::format("{:.6f}", c.mean_ratio),
      number(c.rmse, d.noise.rmse, known), number(c.relmse, d.noise.relmse, known));
  context.out << fmt::format("relMSE without the worst 0.1 % of pixels  {:.6g}\n", c.relmse_trimmed);
  if (!c.worst.empty()) context.out << "worst pixels (x, y: relative squared error; value / reference)\n";
  for (const auto& p : c.worst)
    context.out << fmt::format("  {}, {}: {:.4g}; {:.5g} {:.5g} {:.5g} / {:.5g} {:.5g} {:.5g}\n", p.x, p.y,
                               p.relative_squared_error, p.a[0], p.a[1], p.a[2], p.b[0], p.b[1], p.b[2]);
  if (!known) {
    context.out
        << "noise       not known: neither file has a layer 'variance' or 'error' with numbers (render "
           "with --variance-layer, and 2 iterations or more)\n";
    return 0;
  }
  context.out << fmt::format(
      "noise       relMSE {:.3g} is expected of noise alone; +- is one standard error, of 1.96 each way a "
      "95 % interval\n",
      d.noise.expected_relmse);
  if (has_a != has_b)
    context.out << fmt::format("            {} tells no variance: it is taken as exact\n",
                               printable(has_a ? options.b : options.a));
  for (const auto& [path, variance] : {std::pair(&options.a, &variance_a), {&options.b, &variance_b}})
    if (const std::ptrdiff_t invalid = count_invalid(*variance); invalid > 0)
      context.out << fmt::format(
          "            {}: {} values of the variance are negative or no number: they are taken as exact\n",
          printable(*path), invalid);
  if (correlated(a) || correlated(b))
    context.out << "            photons and chains correlate pixels: standard errors and p are too small\n";
  const std::size_t differing = d.differing.size();
  context.out << fmt::format("blocks      {} of {} differ by more than noise (p < {})\n", differing, d.blocks,
                             stats::kDifferenceP);
  for (std::size_t i = 0; i < std::min<std::size_t>(differing, worst); ++i) {
    const stats::BlockDifference& block = d.differing[i];
    context.out << fmt::format("  {}, {} ({}x{}): p {:.1e}; {:.5g} {:.5g} {:.5g} / {:.5g} {:.5g} {:.5g}\n",
                               block.x, block.y, block.width, block.height, block.p, block.a[0], block.a[1],
                               block.a[2], block.b[0], block.b[1], block.b[2]);
  }
  return 0;
}

}  // namespace

void add_compare(CLI::App& app, Context& context) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* sub = app.add_subcommand(
      "compare",
      "Compare an image with a reference: mean ratio, RMSE, relMSE = mean((a-b)^2 / (b^2 + 0.01 mean(b)^2)). "
      "With a layer 'variance' or 'error', also standard errors, and the blocks of 16x16 pixels that differ "
      "by more than noise; p is the probability of such a difference between equal images");
  sub->add_option("image", options->a, "The image")->required()->type_name("A");
  sub->add_option("reference", options->b, "The reference")->required()->type_name("REFERENCE");
  add_text(*sub, "--worst", options->worst, "Number of the worst pixels and blocks to print (default 5)",
           "N");
  add_text(
      *sub, "--image", options->image,
      "Write the differences as a PNG: red where the image is brighter than the reference, blue where it "
      "is darker",
      "PNG");
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_compare, options);
}

}  // namespace candela::client
