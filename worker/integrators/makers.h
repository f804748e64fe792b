// The makers of the product's integrators: each is defined in its integrator's folder.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"

namespace candela::integrators {

// Fails on settings that the integrator does not know, and on scenes that it cannot render.
using MakeIntegrator = Result<std::unique_ptr<Integrator>>(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features);

MakeIntegrator make_path_integrator;
MakeIntegrator make_bdpt_integrator;
MakeIntegrator make_light_integrator;
MakeIntegrator make_ppm_integrator;
MakeIntegrator make_bpm_integrator;
MakeIntegrator make_vcm_integrator;
MakeIntegrator make_upbp_integrator;
MakeIntegrator make_optimis_integrator;
MakeIntegrator make_fppm_integrator;
MakeIntegrator make_cppm_integrator;
MakeIntegrator make_appm_integrator;
MakeIntegrator make_vcmplus_integrator;
MakeIntegrator make_mcppm_integrator;
MakeIntegrator make_pssmlt_integrator;
MakeIntegrator make_mmlt_integrator;
MakeIntegrator make_mlt_integrator;
MakeIntegrator make_erpt_integrator;

// Tools of `candela inspect`.
MakeIntegrator make_sphere_integrator;
MakeIntegrator make_volume_integrator;
MakeIntegrator make_shares_integrator;

}  // namespace candela::integrators
