// candela check: loads and builds a scene, lists what it uses, and warns of what will look different from
// Mitsuba.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>
#include <set>
#include <thread>

#include "client/check_report.h"
#include "client/context.h"
#include "client/embedded/commands.h"
#include "client/values.h"
#include "common/description/all_errors.h"
#include "common/description/reading_budget.h"
#include "common/description/review.h"
#include "common/image/image.h"
#include "worker/integrators/plan_light.h"
#include "worker/render/renderer.h"
#include "worker/scene/features.h"

namespace candela::client {
namespace {

using description::Finding;

struct CheckOptions {
  SceneOptions scene;
  bool json = false;
  bool strict = false;
};

// An integrator that Candela lacks does not keep the rest of the scene from being checked.
std::optional<Finding> choose_integrator(const description::SceneDescription& scene, SceneOptions& options,
                                         const RendererFacts& facts) {
  const std::vector<std::string> names = facts.integrator_names();
  const auto written = scene.scene->children_of("integrator");
  if (options.integrator || written.empty() ||
      std::find(names.begin(), names.end(), written[0]->plugin) != names.end())
    return std::nullopt;
  options.integrator = "path";
  return Finding{
      Finding::Kind::differs, written[0]->where,
      fmt::format("there is no integrator '{}' here: rendering needs --integrator; checked with 'path'",
                  printable(written[0]->plugin))};
}

// Images that objects refer to, by key.
void collect_images(const description::Object& object, std::set<const description::Object*>& seen,
                    std::set<std::string>& keys) {
  if (!seen.insert(&object).second) return;
  if (object.plugin == "bitmap" || object.plugin == "envmap")
    if (const std::string key = object.get_string("filename", ""); !key.empty()) keys.insert(key);
  for (const description::Child& child : object.children) collect_images(*child.object, seen, keys);
}

std::string shared_face_text(const scene::ShapePlace& first) {
  const std::string name = first.id.empty() ? "" : fmt::format(" ('{}')", printable(first.id));
  return fmt::format(
      "a face of this shape lies in one place with one of the shape at {}:{}{}: rays meet that one alone, "
      "and "
      "light is bent or dimmed as if the other body began elsewhere; leave a gap, or let one body reach into "
      "the other",
      first.file, first.line, name);
}

Result<CheckReport> check_scene(SceneOptions options, const RendererFacts& facts) {
  CANDELA_ASSIGN(const auto parameters, parse_assignments(options.defines, "-D"));
  CANDELA_ASSIGN(const std::uint64_t memory, scene_memory_bytes(options));
  CANDELA_ASSIGN(const bundle::GatheredScene gathered,
                 bundle::gather(options.scene, parameters, options.reading(), memory));
  const description::SceneDescription& scene = gathered.description;
  std::optional<Finding> integrator = choose_integrator(scene, options, facts);
  CANDELA_ASSIGN(const PreparedJob job, prepare_job(scene, options, facts));
  if (!integrator && job.other_integrator)
    integrator = Finding{Finding::Kind::differs, job.other_integrator->where, job.other_integrator->text};
  if (!integrator && job.default_integrator)
    integrator = Finding{Finding::Kind::differs, job.default_integrator->where, job.default_integrator->text};
  const bundle::DiskSource files(std::filesystem::absolute(options.scene).parent_path());
  CANDELA_ASSIGN(
      const scene::SceneFeatures features,
      render::check_scene(files, gathered.bundle.main_path, gathered.bundle.parameters, job.settings,
                          std::max(1U, std::thread::hardware_concurrency()), memory));

  CheckReport report;
  report.scene = options.scene;
  report.review = description::review(scene);
  if (integrator) report.review.findings.insert(report.review.findings.begin(), *integrator);
  report.triangles = features.triangles;
  report.dropped_faces = features.dropped_faces;
  if (report.dropped_faces > 0)
    report.review.findings.push_back(
        {Finding::Kind::ignored, scene.scene->where,
         fmt::format("{} faces of meshes have no area and are left out", report.dropped_faces)});
  for (const auto& [first, second] : features.shared_faces)
    report.review.findings.push_back(
        {Finding::Kind::differs, {second.file, second.line}, shared_face_text(first)});
  const std::string missing =
      integrators::missing_light(features, job.settings.integrator, job.settings.integrator_settings);
  const auto written = scene.scene->children_of("integrator");
  if (!missing.empty())
    report.review.findings.push_back({Finding::Kind::missing,
                                      written.empty() ? scene.scene->where : written[0]->where,
                                      fmt::format("light that is missing: {}", missing)});
  report.width = job.settings.width;
  report.height = job.settings.height;
  report.filter = job.settings.filter;
  report.integrator = job.settings.integrator;
  report.integrator_settings = job.settings.integrator_settings;
  for (const bundle::File& file : gathered.bundle.files) report.files.push_back({file.path, file.size_bytes});
  std::set<const description::Object*> seen;
  std::set<std::string> keys;
  collect_images(*scene.scene, seen, keys);
  for (const std::string& key : keys) {
    const bundle::File* file = gathered.bundle.find(key);
    const auto path = gathered.real_paths.find(key);
    if (file == nullptr || path == gathered.real_paths.end()) continue;
    CANDELA_ASSIGN(const image::ImageSize size, image::read_image_size(path->second));
    report.images.push_back({key, size.width, size.height, size.channels, size.bits, file->size_bytes});
  }
  return report;
}

// The errors of the scene's text. Places are named by file.
std::vector<Error> errors_of(const SceneOptions& options) {
  const std::filesystem::path path(options.scene);
  const bundle::DiskSource files(path.parent_path());
  const std::string main_key = path.filename().string();
  const auto parameters = parse_assignments(options.defines, "-D");
  const auto memory = scene_memory_bytes(options);
  if (!parameters.ok() || !memory.ok() || main_key.empty()) return {};
  description::ReadingBudget budget(*memory);
  const description::BudgetedFiles counted(files, budget);
  std::vector<Error> errors = description::all_errors(counted, main_key, *parameters, options.reading());
  for (Error& error : errors)
    if (error.line > 0 || error.file == main_key) error.file = files.real_path(error.file).string();
  return errors;
}

Result<int> run_check(Context& context, const CheckOptions& options) {
  const Result<CheckReport> checked = check_scene(options.scene, context.facts);
  if (!checked.ok()) {
    const std::vector<Error> errors = errors_of(options.scene);
    if (errors.empty()) return checked.error();  // of the building, or of an option
    // The last error is told by the program.
    for (std::size_t i = 0; i + 1 < errors.size(); ++i)
      context.err << fmt::format("candela: error: {}\n", printable(errors[i].to_string()));
    if (errors.size() == description::kMaxErrors)
      context.err << fmt::format("candela: note: there may be more than these {} errors\n", errors.size());
    return errors.back();
  }
  const CheckReport& report = *checked;
  if (options.json) {
    context.out << report.to_json() << '\n';
  } else {
    context.out << report.to_text();
  }
  return options.strict && report.warning_count() > 0 ? 1 : 0;
}

}  // namespace

void add_check(CLI::App& app, Context& context) {
  auto options = std::make_shared<CheckOptions>();
  CLI::App* sub = app.add_subcommand(
      "check", "Build the scene, list its features or all its errors, and warn of differences from Mitsuba");
  add_scene_options(*sub, options->scene, false);
  sub->add_flag("--strict", options->strict, "Exit with 1 if there is a warning");
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_check, options);
}

}  // namespace candela::client
