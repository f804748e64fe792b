// candela reproduce: the command that makes an image again, by what the image says of itself; with --run it
// is made, and compared to the last bit.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>
#include <system_error>

#include "client/commands/waiting.h"
#include "client/context.h"
#include "client/embedded/commands.h"
#include "client/embedded/render.h"
#include "client/passing_folder.h"
#include "client/submission.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/base/shell_words.h"
#include "common/base/version.h"
#include "common/image/bits.h"
#include "common/image/mix.h"
#include "common/job/render_command.h"

namespace candela::client {
namespace {

constexpr std::string_view kOutput = "reproduced.exr";
constexpr std::uint64_t kMaxImageBytes = std::uint64_t{1} << 36;

struct ReproduceOptions {
  std::string image;
  std::optional<std::string> scene, output, threads;
  FarmOptions farm;
  bool run = false, quiet = false, resume = false, fresh = false;
};

// An image and what it says of itself.
struct Origin {
  std::map<std::string, std::string> texts;
  RenderCommand command;
  std::optional<image::Mix> mix;  // of the layers of the image that the command makes

  std::string text(const std::string& name) const {
    const auto found = texts.find("candela:" + name);
    return found == texts.end() ? std::string() : found->second;
  }
};

Result<Origin> read_origin(const ReproduceOptions& options) {
  Origin origin;
  CANDELA_ASSIGN(origin.texts, image::read_texts(options.image));
  const auto no = [&](std::string message) { return input_error(std::move(message)).at(options.image, 0); };
  if (!origin.texts.contains("candela:build_id")) return no("this is no image of Candela, or it was edited");
  if (const std::string taint = origin.text("run:taint"); !taint.empty())
    return no("the image cannot be made again: " + printable(taint));
  if (const std::string builds = origin.text("run:builds"); !builds.empty())
    return no("the image cannot be made again: it has samples of several builds: " + printable(builds));
  if (!origin.texts.contains("candela:indices_a"))
    return no(fmt::format("an image of version {} does not say which samples it has",
                          printable(origin.text("version"))))
        .with_mend("fetch it again from a master of this version");
  const std::string line = origin.text("reproduce");
  if (line.empty())
    return no(
        fmt::format("the image tells of no command: its samples are more than {} ranges, or its "
                    "scene's files were not known",
                    film::kMaxIndexRanges));
  auto command = parse_render_command(line);
  if (!command) return no("candela:reproduce cannot be used: " + command.error().to_string());
  origin.command = std::move(command).value();
  if (options.scene) origin.command.scene = *options.scene;
  if (const std::string text = origin.text("mix"); !text.empty()) {
    auto mix = image::parse_mix(text);
    if (!mix) return no("candela:mix cannot be used: " + mix.error().to_string());
    origin.mix = std::move(mix).value();
  }
  return origin;
}

SceneOptions scene_options(const RenderCommand& command) {
  SceneOptions out;
  const JobSettings& s = command.settings;
  out.scene = command.scene;
  out.lenient = true;
  for (const auto& [name, value] : command.parameters) out.defines.push_back(name + '=' + value);
  for (const auto& [name, value] : s.integrator_settings) out.sets.push_back(name + '=' + value);
  out.integrator = s.integrator;
  out.indices = command.indices;
  out.seed = fmt::format("{}", s.seed);
  out.size = s.crop ? fmt::format("{}x{}", s.crop->whole_width, s.crop->whole_height)
                    : fmt::format("{}x{}", s.width, s.height);
  if (s.crop) out.crop = fmt::format("{},{},{},{}", s.crop->x, s.crop->y, s.width, s.height);
  out.filter = s.filter;
  out.sampler = s.sampler;
  out.isa = s.isa;
  out.aov = s.aovs.empty() ? "none" : s.aovs;
  out.layers = {s.layers.empty() ? "none" : s.layers};
  out.edits = s.edits.empty() ? "none" : s.edits;
  return out;
}

std::optional<std::string> optional_text(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(text);
}

ImageOptions image_options(const RenderCommand& command) {
  ImageOptions image;
  image.request = {.error_layer = command.error_layer,
                   .chain_layers = command.chain_layers,
                   .variance_layer = command.variance_layer};
  image.estimator = optional_text(command.estimator);
  image.half = optional_text(command.half);
  return image;
}

// The image says its settings in this form.
std::string text_of(const SettingsMap& settings) {
  std::string out;
  for (const auto& [key, value] : settings)
    out += fmt::format("{}{}={}", out.empty() ? "" : ", ", key, value);
  return out;
}

// A relative path of an image that was moved leads nowhere.
Result<void> check_place(const std::string& scene) {
  std::error_code error;
  if (std::filesystem::exists(scene, error)) return {};
  return input_error("the image's scene is not there").at(scene, 0).with_mend("give it by --scene PATH");
}

// Fails unless the scene loaded here is the one that the image was made of.
Result<void> check_scene(const LoadedScene& scene, const Origin& origin) {
  if (scene.gathered.bundle.hash() != origin.text("bundle"))
    return input_error("the scene, one of its files or a file's place has changed since the image was made")
        .at(scene.path, 0)
        .with_mend("give the scene as it was by --scene PATH");
  const JobSettings& s = scene.job.settings;
  for (const auto& [name, here] :
       {std::pair<const char*, std::string>{"settings", text_of(s.integrator_settings)},
        {"filter_settings", text_of(s.filter_settings)},
        {"aovs", s.aovs},
        {"expressions", s.layers},
        {"edits", s.edits}})
    if (here != origin.text(name))
      return input_error(fmt::format("{} come out as '{}' here, and were '{}'", name, printable(here),
                                     printable(origin.text(name))))
          .at(scene.path, 0)
          .with_mend("use the build that made the image");
  return {};
}

// Differences that may or may not change a bit.
void warn_of_build(std::ostream& err, const Origin& origin) {
  if (origin.text("build_id") != build_id())
    err << fmt::format(
        "candela: warning: the image is of version {}, build {}; this is build {}, which may "
        "make other bits\n",
        printable(origin.text("version")), printable(origin.text("build_id")), build_id());
}

Result<int> print_command(Context& context, const ReproduceOptions& options, const Origin& origin) {
  const std::string output = options.output.value_or(std::string(kOutput));
  context.out << printable(shell_line(words_of(origin.command, output))) << '\n';
  if (origin.mix)
    context.out << fmt::format(
        "echo {} > mix.json\n{}\n", printable(shell_quote(text_of(*origin.mix))),
        printable(shell_line({"candela", "convert", output, output, "--mix", "mix.json"})));
  warn_of_build(context.err, origin);
  const auto warn = [&](const Error& error) {
    context.err << "candela: warning: " << printable(error.to_string()) << '\n';
  };
  const std::vector<std::string> isas = context.facts.supported_isas();
  if (std::find(isas.begin(), isas.end(), origin.command.settings.isa) == isas.end())
    context.err << fmt::format("candela: warning: this machine has no {}: render it on a farm that has\n",
                               printable(origin.command.settings.isa));
  const auto there = check_place(origin.command.scene);
  if (!there) {
    warn(there.error());
    return 0;
  }
  const auto scene = load_scene(scene_options(origin.command), context.facts);
  if (!scene)
    warn(scene.error());
  else if (const auto same = check_scene(*scene, origin); !same)
    warn(same.error());
  return 0;
}

Result<int> render_here(Context& context, const ReproduceOptions& options, const Origin& origin,
                        const std::string& output) {
  const RenderCommand& command = origin.command;
  RenderOptions render;
  render.scene = scene_options(command);
  render.output = output;
  render.threads = options.threads;
  render.image = image_options(command);
  render.quiet = options.quiet;
  render.resume = options.resume;
  render.fresh = options.fresh;
  if (!options.output) render.keep_as = kOutput;
  render.check = [&origin](const LoadedScene& scene) { return check_scene(scene, origin); };
  return run_render(context, render);
}

Result<int> render_on_farm(Context& context, const ReproduceOptions& options, const Origin& origin,
                           const std::string& output) {
  const RenderCommand& command = origin.command;
  WaitOptions wait{.quiet = options.quiet, .output = {output, {}}};
  CANDELA_ASSIGN(wait.request, request_of(image_options(command)));
  CANDELA_TRY(check_output(wait.output));
  CANDELA_ASSIGN(const LoadedScene scene, load_scene(scene_options(command), context.facts));
  CANDELA_TRY(check_scene(scene, origin));
  warn_of_scene(context.err, scene);
  CANDELA_ASSIGN(const std::unique_ptr<FarmClient> farm, connect(options.farm));
  Submission submission;
  submission.name = origin.text("name").substr(0, Limits::max_name_bytes);
  Submitted submitted;
  {
    ProgressLine progress(context.err, ProgressLine::mode_for(options.quiet));
    CANDELA_ASSIGN(submitted, submit_scene(*farm, scene, context.facts, submission, progress));
  }
  context.err << fmt::format("candela: job {}\n", printable(submitted.job_id)) << std::flush;
  return wait_for_job(context, *farm, submitted.job_id, wait);
}

Result<int> run_reproduce(Context& context, const ReproduceOptions& options) {
  if (!options.run)
    for (const auto& [given, option] :
         {std::pair<bool, const char*>{options.farm.master.has_value(), "--master"},
          {options.threads.has_value(), "--threads"},
          {options.resume, "--resume"},
          {options.fresh, "--fresh"}})
      if (given) return usage_error("nothing is rendered without --run").with_field(option);
  if (options.farm.master && (options.threads || options.resume || options.fresh))
    return usage_error("--threads, --resume and --fresh are of a render in this process")
        .with_field("--master");
  if (options.output) CANDELA_TRY(check_output_path(*options.output, ".exr", "-o"));
  if ((options.resume || options.fresh) && !options.output)
    return usage_error("without -o no state is kept").with_field(options.resume ? "--resume" : "--fresh");
  CANDELA_ASSIGN(const Origin origin, read_origin(options));
  if (!options.run) return print_command(context, options, origin);
  std::error_code error;
  if (options.output && std::filesystem::equivalent(*options.output, options.image, error))
    return usage_error("the image would be overwritten that is to be compared").with_field("--output");
  warn_of_build(context.err, origin);
  CANDELA_TRY(check_place(origin.command.scene));
  PassingFolder folder;
  if (!options.output) {
    CANDELA_ASSIGN(folder, PassingFolder::make());
  }
  const std::string output = options.output.value_or((folder.path() / kOutput).string());
  CANDELA_ASSIGN(const int code, options.farm.master ? render_on_farm(context, options, origin, output)
                                                     : render_here(context, options, origin, output));
  if (code != 0) return code;
  if (origin.mix) {
    CANDELA_ASSIGN(const std::string exr, read_file(output, kMaxImageBytes));
    CANDELA_ASSIGN(const image::MixedExr mixed, image::mix_exr(exr, *origin.mix));
    CANDELA_TRY(write_file_atomically(output, mixed.bytes));
  }
  CANDELA_ASSIGN(const image::BitComparison bits, image::compare_bits(options.image, output));
  if (!bits.missing.empty())
    context.err << fmt::format("candela: note: not compared, since they tell of the run: {}\n",
                               printable(join(bits.missing, ", ")));
  if (bits.differing.empty()) {
    context.out << fmt::format("equal: {} channels of {} pixels, bit by bit\n", bits.equal.size(),
                               bits.pixels);
    return 0;
  }
  context.out << fmt::format("not equal: {} of {} pixels differ, in {}\n", bits.differing_pixels, bits.pixels,
                             printable(join(bits.differing, ", ")));
  return 1;
}

}  // namespace

void add_reproduce(CLI::App& app, Context& context) {
  auto options = std::make_shared<ReproduceOptions>();
  CLI::App* sub =
      app.add_subcommand("reproduce",
                         "Print the command that makes an image again with the same bits, and the "
                         "differences of this machine; with --run, render the image and compare");
  sub->add_option("image", options->image, "The image (.exr)")->required()->type_name("IMAGE");
  sub->add_flag("--run", options->run,
                "Render the image here, or on a farm with --master, and compare the pixels: exit code 0 if "
                "they are equal, 1 if not");
  add_text(*sub, "--scene", options->scene, "Path of the scene file, if it was moved", "PATH");
  add_text(*sub, "-o,--output", options->output, "Write the new image here (.exr; default: it is not kept)",
           "FILE");
  add_text(*sub, "--threads", options->threads, "Threads in all (default: all cores)", "N");
  sub->add_flag("--resume", options->resume, "Continue a stopped --run; needs -o");
  sub->add_flag("--fresh", options->fresh, "Delete the state of a stopped --run and start again; needs -o");
  sub->add_flag("--quiet", options->quiet, "Print no progress");
  add_farm_options(*sub, options->farm);
  set_command(*sub, context, run_reproduce, options);
}

}  // namespace candela::client
