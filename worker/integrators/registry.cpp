#include "worker/integrators/registry.h"

#include <string_view>

#include "common/job/integrator_words.h"
#include "common/job/tools.h"
#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/erpt/settings.h"
#include "worker/integrators/light/settings.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/mcppm/settings.h"
#include "worker/integrators/mlt/settings.h"
#include "worker/integrators/mmlt/settings.h"
#include "worker/integrators/optimis/settings.h"
#include "worker/integrators/path/settings.h"
#include "worker/integrators/ppm/settings.h"
#include "worker/integrators/pssmlt/settings.h"
#include "worker/integrators/shares/settings.h"
#include "worker/integrators/sphere/settings.h"
#include "worker/integrators/upbp/settings.h"
#include "worker/integrators/vcm/settings.h"
#include "worker/integrators/vcmplus/settings.h"
#include "worker/integrators/volume/settings.h"

namespace candela::integrators {

std::vector<IntegratorEntry> product_integrators() {
  return {
      integrator_entry<PathSettings>(integrator_words::kPath.name, &make_path_integrator),
      integrator_entry<BdptSettings>(integrator_words::kBdpt.name, &make_bdpt_integrator),
      integrator_entry<LightSettings>(integrator_words::kLight.name, &make_light_integrator),
      integrator_entry<PpmSettings>(integrator_words::kPpm.name, &make_ppm_integrator),
      integrator_entry<BpmSettings>(integrator_words::kBpm.name, &make_bpm_integrator),
      integrator_entry<VcmSettings>(integrator_words::kVcm.name, &make_vcm_integrator),
      integrator_entry<UpbpSettings>(integrator_words::kUpbp.name, &make_upbp_integrator),
      integrator_entry<OptimisSettings>(integrator_words::kOptimis.name, &make_optimis_integrator),
      integrator_entry<adaptive::FppmSettings>(integrator_words::kFppm.name, &make_fppm_integrator),
      integrator_entry<adaptive::CppmSettings>(integrator_words::kCppm.name, &make_cppm_integrator),
      integrator_entry<adaptive::AppmSettings>(integrator_words::kAppm.name, &make_appm_integrator),
      integrator_entry<VcmplusSettings>(integrator_words::kVcmplus.name, &make_vcmplus_integrator),
      integrator_entry<McppmSettings>(integrator_words::kMcppm.name, &make_mcppm_integrator),
      integrator_entry<PssmltSettings>(integrator_words::kPssmlt.name, &make_pssmlt_integrator),
      integrator_entry<MmltSettings>(integrator_words::kMmlt.name, &make_mmlt_integrator),
      integrator_entry<MltSettings>(integrator_words::kMlt.name, &make_mlt_integrator),
      integrator_entry<ErptSettings>(integrator_words::kErpt.name, &make_erpt_integrator),
  };
}

namespace {

// Integrators of jobs of `candela inspect`. They are in no list: they render no image.
const std::vector<IntegratorEntry>& tool_integrators() {
  static const std::vector<IntegratorEntry> entries = {
      integrator_entry<SphereSettings>(tools::kSphere, &make_sphere_integrator),
      integrator_entry<VolumeSettings>(tools::kVolume, &make_volume_integrator),
      integrator_entry<SharesSettings>(tools::kShares, &make_shares_integrator)};
  return entries;
}

}  // namespace

Result<const IntegratorEntry*> find_integrator(std::string_view name) {
  for (const IntegratorEntry& entry : tool_integrators())
    if (entry.name == name) return &entry;
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
