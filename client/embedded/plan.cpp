// candela plan: what a scene has, what the integrator will run for it, and what it skips and why.

#include <CLI/CLI.hpp>
#include <ostream>
#include <thread>

#include "client/context.h"
#include "client/embedded/commands.h"
#include "client/json.h"
#include "worker/render/renderer.h"

namespace candela::client {
namespace {

struct PlanOptions {
  SceneOptions scene;
  bool json = false;
};

Result<int> run_plan(Context& context, const PlanOptions& options) {
  CANDELA_ASSIGN(const LoadedScene scene, load_scene(options.scene, context.facts));
  warn_of_scene(context.err, scene);
  const bundle::DiskSource files(std::filesystem::absolute(options.scene.scene).parent_path());
  CANDELA_ASSIGN(
      const auto renderer,
      render::Renderer::create(files, scene.gathered.bundle.main_path, scene.gathered.bundle.parameters,
                               scene.job.settings, std::max(1U, std::thread::hardware_concurrency()), {},
                               scene.memory_bytes));
  CANDELA_ASSIGN(const std::string text, renderer->plan_text());
  if (options.json) {
    context.out << plan_json(scene.job.settings.integrator, scene.job.settings.integrator_settings, text)
                << '\n';
    return 0;
  }
  context.out << text;
  if (!text.ends_with('\n')) context.out << '\n';
  return 0;
}

}  // namespace

void add_plan(CLI::App& app, Context& context) {
  auto options = std::make_shared<PlanOptions>();
  CLI::App* sub =
      app.add_subcommand("plan", "Print the scene's features, what will run, and what is skipped and why");
  add_scene_options(*sub, options->scene, false);
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_plan, options);
}

}  // namespace candela::client
