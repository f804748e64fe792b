#include "worker/integrators/registry.h"

#include <string_view>

#include "worker/integrators/bdpt/bdpt.h"
#include "worker/integrators/light/light.h"
#include "worker/integrators/markov/markov.h"
#include "worker/integrators/mmlt/mmlt.h"
#include "worker/integrators/path/path.h"
#include "worker/integrators/ppm/ppm.h"
#include "worker/integrators/pssmlt/pssmlt.h"
#include "worker/integrators/vcm/vcm.h"

namespace candela::integrators {

std::vector<IntegratorEntry> product_integrators() {
  return {
      integrator_entry<PathSettings>("path", &make_path_integrator),
      integrator_entry<BdptSettings>("bdpt", &make_bdpt_integrator),
      integrator_entry<LightSettings>("light", &make_light_integrator),
      integrator_entry<PpmSettings>("ppm", &make_ppm_integrator),
      integrator_entry<BpmSettings>("bpm", &make_bpm_integrator),
      integrator_entry<VcmSettings>("vcm", &make_vcm_integrator),
      integrator_entry<PssmltSettings>("pssmlt", &make_pssmlt_integrator),
      integrator_entry<MmltSettings>("mmlt", &make_mmlt_integrator),
  };
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

}  // namespace candela::integrators
