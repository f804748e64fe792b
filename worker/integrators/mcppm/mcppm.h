// Photon mapping with Metropolis chains of visible photons [Hachisuka 2011], in a form whose iterations are
// independent and exact [metropolis-photons note, section 6]:
//
//   unit(i):  r = r_i, theta = the step size of i's epoch; N, M settings
//     eye paths      the places where they gather photons, in a range search
//     light paths    N independent ones. Path u is visible if it leaves a photon within r of such a place;
//                    v paths are, numbered c = 0 ... v - 1. v = 0: the iteration is black, and counts
//     chains         path c starts a chain of L = M div v + (c < M mod v) mutations, which accepts what is
//                    visible. Each of its 1 + L states adds its photons with the weight 1 / (N (1 + L))
//     gathering      as ppm, from the photons of all states
//
// Given which paths are visible, every state is uniform on the visible set, so the expectation is that of ppm
// with the same radius: for any N, M and theta, whether chains mix or not. Nothing but "visible or not"
// enters L and the weights. Against [Hachisuka 2011]: no chain goes on to another iteration, no normalization
// is pooled over iterations, no step size adapts inside one.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/mcppm/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_mcppm_integrator(const SettingsMap& settings,
                                                          const scene::SceneFeatures& features);

}  // namespace candela::integrators
