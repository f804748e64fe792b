#include "client/embedded/falsecolor_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <ostream>
#include <system_error>

#include "client/commands/waiting.h"
#include "client/embedded/inspect_farm.h"
#include "client/embedded/render.h"
#include "client/jobs_of_words.h"
#include "client/output.h"
#include "client/scene_name.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/image/bits.h"
#include "common/job/aov.h"
#include "common/job/layer_name.h"
#include "common/letters/normal_form.h"

namespace candela::client {
namespace {

constexpr std::string_view kSelected = "select";  // the layer of --select in an image of a scene
constexpr std::string_view kIrradiance = "irradiance", kAlbedo = "albedo";

ImageRequest request_of(const FalseColorSource& source) {
  ImageRequest request;
  request.error_layer = source.layer == kErrorLayer;
  request.variance_layer = source.layer == kVarianceLayer;
  return request;
}

// The scene's options, with what the layer needs.
SceneOptions scene_of(const FalseColorSource& source) {
  SceneOptions scene = source.scene;
  scene.scene = source.input;
  if (source.select) scene.layers = {fmt::format("{}={}", kSelected, *source.select)};
  if (scene.aov || !source.layer) return scene;
  if (*source.layer == kIrradiance)
    scene.aov = kAlbedo;
  else if (parse_aovs(*source.layer).ok())  // the name of a kind
    scene.aov = *source.layer;
  return scene;
}

// The user has named the layer of --select by its expression.
Error in_users_words(Error error, const FalseColorSource& source) {
  return source.select && error.field == "--layer" ? std::move(error).with_field("--select")
                                                   : std::move(error);
}

Result<int> render_here(Context& context, const FalseColorSource& source, const std::string& file) {
  RenderOptions render;
  render.scene = scene_of(source);
  render.output = file;
  render.image.request = request_of(source);
  render.threads = source.threads;
  render.quiet = source.quiet;
  render.passing = true;
  return run_render(context, render);
}

Result<int> render_on_farm(Context& context, const FalseColorSource& source, const std::string& file) {
  CANDELA_ASSIGN(const LoadedScene scene, load_scene(scene_of(source), context.facts));
  warn_of_scene(context.err, scene);
  const WaitOptions wait{.quiet = source.quiet, .request = request_of(source), .output = {file, {}}};
  CANDELA_ASSIGN(
      const JobRun run,
      run_job(context, source.farm, fmt::format("falsecolor of {}", scene_name(source.input)), scene, wait));
  return run.code;
}

// The image of a job so far.
Result<void> fetch_job(const FalseColorSource& source, const std::string& file) {
  CANDELA_ASSIGN(const auto farm, connect(source.farm));
  CANDELA_ASSIGN(const v1::JobName job, job_of_word(*farm, source.input));
  CANDELA_ASSIGN(const std::string exr, farm->fetch_image(job.id(), request_of(source)));
  return write_file_atomically(file, exr);
}

}  // namespace

bool is_scene(const FalseColorSource& source) {
  const std::string& name = source.input;
  const bool ends_so = name.ends_with(".xml") || name.ends_with(".pbrt") || name.ends_with(".pbrt.gz");
  std::error_code error;
  return ends_so && (!source.farm.master || std::filesystem::exists(name, error));
}

Result<void> check_select(const FalseColorSource& source) {
  if (!source.select) {
    if (source.scene.regions.empty()) return {};
    return usage_error("a region is named for --select")
        .with_field("--region")
        .with_mend("give --select EXPR");
  }
  if (source.layer) return usage_error("--layer and --select exclude each other").with_field("--select");
  if (source.select->empty()) return usage_error("the expression is empty").with_field("--select");
  auto tree = letters::parse_expression(*source.select);
  if (!tree) return std::move(tree).error().with_field("--select");
  return {};
}

Result<SourceFile> source_file(Context& context, const FalseColorSource& source) {
  SourceFile made;
  made.path = source.input;
  const bool scene = is_scene(source);
  if (!scene && !source.farm.master) return made;
  CANDELA_ASSIGN(made.folder, PassingFolder::make());
  made.path = (made.folder.path() / "image.exr").string();
  if (!scene) {
    CANDELA_TRY(fetch_job(source, made.path));
    return made;
  }
  auto code = source.farm.master ? render_on_farm(context, source, made.path)
                                 : render_here(context, source, made.path);
  if (!code) return in_users_words(std::move(code).error(), source);
  made.code = *code;
  return made;
}

Result<std::string> layer_of_expression(const std::string& path, const std::string& shown,
                                        const std::string& expression) {
  CANDELA_ASSIGN(const letters::Node wanted, letters::parse_expression(expression));
  auto texts = image::read_texts(path);
  if (!texts) {
    Error error = std::move(texts).error();
    return error.file == path ? std::move(error).at(shown, 0) : std::move(error);
  }
  letters::LayerRequest request;
  if (const auto found = texts->find("candela:expressions"); found != texts->end())
    if (auto read = letters::parse_layer_request(found->second)) request = *std::move(read);
  for (const letters::NamedExpression& layer : request.layers)
    if (const auto tree = letters::parse_expression(layer.text);
        tree && letters::normal_form(*tree) == letters::normal_form(wanted))
      return layer.name;
  constexpr std::size_t most_named = 5;
  std::string others;
  for (std::size_t i = 0; i < std::min(request.layers.size(), most_named); ++i)
    others += fmt::format("{}{}={}", i == 0 ? "" : ", ", request.layers[i].name, request.layers[i].text);
  if (request.layers.size() > most_named) others += ", ...";
  if (request.light_groups) others += others.empty() ? "light groups" : ", and light groups";
  return input_error(fmt::format("the image has no layer of the expression '{}'", printable(expression)))
      .at(shown, 0)
      .with_field("--select")
      .with_mend(fmt::format("{}give the scene in place of the image, or render with --layer NAME=EXPR",
                             others.empty() ? "" : fmt::format("there is {}; ", printable(others))));
}

}  // namespace candela::client
