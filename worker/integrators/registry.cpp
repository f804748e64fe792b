#include <array>
#include <string_view>

#include "common/description/vocabulary.h"
#include "worker/integrators/bdpt/bdpt.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/light/light.h"
#include "worker/integrators/markov/markov.h"
#include "worker/integrators/mmlt/mmlt.h"
#include "worker/integrators/path/path.h"
#include "worker/integrators/ppm/ppm.h"
#include "worker/integrators/pssmlt/pssmlt.h"
#include "worker/integrators/settings.h"
#include "worker/integrators/vcm/vcm.h"

namespace candela::integrators {
namespace {

template <class Settings>
Result<SettingsMap> complete(const SettingsMap& given) {
  CANDELA_ASSIGN(const Settings settings, parse_settings<Settings>(given));
  if constexpr (requires { settings.markov; }) CANDELA_TRY(check(settings.markov));
  return write_settings(settings).map;
}

template <class Settings>
std::vector<SettingDoc> document() {
  return write_settings(Settings{}).docs;
}

}  // namespace

const std::vector<IntegratorEntry>& registry() {
  static const std::vector<IntegratorEntry> entries = {
      {"path", &make_path_integrator, &complete<PathSettings>, &document<PathSettings>},
      {"bdpt", &make_bdpt_integrator, &complete<BdptSettings>, &document<BdptSettings>},
      {"light", &make_light_integrator, &complete<LightSettings>, &document<LightSettings>},
      {"ppm", &make_ppm_integrator, &complete<PpmSettings>, &document<PpmSettings>},
      {"bpm", &make_bpm_integrator, &complete<BpmSettings>, &document<BpmSettings>},
      {"vcm", &make_vcm_integrator, &complete<VcmSettings>, &document<VcmSettings>},
      {"pssmlt", &make_pssmlt_integrator, &complete<PssmltSettings>, &document<PssmltSettings>},
      {"mmlt", &make_mmlt_integrator, &complete<MmltSettings>, &document<MmltSettings>},
  };
  return entries;
}

Result<const IntegratorEntry*> find_integrator(std::string_view name) {
  std::string names;
  for (const IntegratorEntry& entry : registry()) {
    if (entry.name == name) return &entry;
    names += (names.empty() ? "" : ", ") + std::string(entry.name);
  }
  return usage_error("unknown integrator '" + std::string(name) + "'")
      .with_field("integrator")
      .with_mend("there is " + names);
}

Result<void> ChainIntegrator::run(const UnitContext& /*context*/, const Unit& /*unit*/,
                                  film::UnitFilm& /*film*/, const RunContext& /*run*/) const {
  return internal_error("a job of Markov chains has no iterations");
}

std::string Plan::to_text() const {
  std::string text;
  constexpr std::array<std::string_view, 3> kKinds = {"use  ", "skip ", "note "};  // PlanItem::Kind
  for (const PlanItem& item : items) {
    text += kKinds[static_cast<std::size_t>(item.kind)];
    text += item.technique + ": " + item.reason + '\n';
  }
  return text;
}

}  // namespace candela::integrators
