#include <fmt/format.h>

#include "common/description/vocabulary.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/path/path.h"
#include "worker/integrators/settings.h"

namespace candela::integrators {
namespace {

template <class Settings>
Result<SettingsMap> complete(const SettingsMap& given) {
  CANDELA_ASSIGN(const Settings settings, parse_settings<Settings>(given));
  return write_settings(settings).map;
}

template <class Settings>
std::vector<render::SettingDoc> document() {
  return write_settings(Settings{}).docs;
}

}  // namespace

const std::vector<IntegratorEntry>& registry() {
  static const std::vector<IntegratorEntry> entries = {
      {"path", &make_path_integrator, &complete<PathSettings>, &document<PathSettings>},
  };
  return entries;
}

Result<const IntegratorEntry*> find_integrator(std::string_view name) {
  std::vector<std::string_view> names;
  for (const IntegratorEntry& entry : registry()) {
    if (entry.name == name) return &entry;
    names.push_back(entry.name);
  }
  return usage_error(fmt::format("unknown integrator '{}'", name))
      .with_field("integrator")
      .with_mend(fmt::format("there is {}", fmt::join(names, ", ")));
}

std::string Plan::to_text() const {
  std::string text;
  for (const PlanItem& item : items)
    text += fmt::format("{} {}: {}\n", item.used ? "use " : "skip", item.technique, item.reason);
  return text;
}

}  // namespace candela::integrators
