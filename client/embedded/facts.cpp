#include <algorithm>
#include <thread>

#include "client/embedded/commands.h"
#include "worker/render/renderer.h"

namespace candela::client {

RendererFacts renderer_facts() {
  RendererFacts facts;
  facts.integrator_names = [] { return render::integrator_names(); };
  facts.setting_names = [](const std::string& integrator) -> Result<std::vector<std::string>> {
    CANDELA_ASSIGN(const auto docs, render::integrator_settings(integrator));
    std::vector<std::string> names;
    for (const auto& doc : docs) names.push_back(doc.name);
    return names;
  };
  facts.setting_docs = [](const std::string& integrator) -> Result<std::vector<IntegratorSetting>> {
    CANDELA_ASSIGN(const auto docs, render::integrator_settings(integrator));
    std::vector<IntegratorSetting> out;
    for (const auto& doc : docs) out.push_back({doc.name, doc.type, doc.default_value, doc.doc});
    return out;
  };
  facts.complete_settings = [](const std::string& integrator, const SettingsMap& from_scene,
                               const SettingsMap& from_user) {
    return render::complete_integrator_settings(integrator, from_scene, from_user);
  };
  facts.supported_isas = [] { return render::supported_isas(); };
  facts.largest_work = [](const JobSettings& settings) { return render::largest_work(settings); };
  facts.work_of = [](const LoadedScene& scene) -> Result<WorkPlan> {
    const unsigned threads = std::max(1U, std::thread::hardware_concurrency());
    CANDELA_ASSIGN(const auto renderer,
                   render::Renderer::create(bundle::DiskSource(scene.folder), scene.gathered.bundle.main_path,
                                            scene.gathered.bundle.parameters, scene.job.settings, threads, {},
                                            scene.memory_bytes));
    CANDELA_ASSIGN(PilotResult pilot, renderer->pilot({threads}));
    return std::move(pilot.work);
  };
  facts.settings_of_effort = [](const std::string& integrator, const Effort& effort) {
    return render::integrator_settings_of_effort(integrator, effort);
  };
  facts.samples_per_iteration = [](const std::string& integrator, const SettingsMap& settings) {
    return render::samples_per_iteration(integrator, settings);
  };
  return facts;
}

}  // namespace candela::client
