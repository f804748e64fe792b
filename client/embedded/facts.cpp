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
  facts.complete_settings = [](const std::string& integrator, const SettingsMap& from_scene,
                               const SettingsMap& from_user) {
    return render::complete_integrator_settings(integrator, from_scene, from_user);
  };
  return facts;
}

}  // namespace candela::client
