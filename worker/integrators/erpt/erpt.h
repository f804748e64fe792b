// Energy redistribution path tracing [Cline 2005], in a form whose iterations are independent and exact
// [metropolis-photons note, sections 1 to 4]:
//
//   pilot      from independent samples: b0, the mean of their scalar contributions I, and rho^2, their
//              relative variance. The energy of a chain is e_d = k b0, k = (1 + rho^2) / 2, and its length
//              M = m k, m the mutations for each seed
//   unit(i)    N seeds, each an independent path of bidirectional path tracing, and their chains
//              (mcmc/redistribution.h); path tracing of what is left to it
//
// The states of chains are paths, and mutations those of mlt (mcmc/path_space.h). Against [Cline 2005]: e_d
// is not b, and nothing is filtered. The pilot decides noise and work alone: any e_d and M give the same
// mean. No normalization is pooled, and no chain goes on to another iteration.
#pragma once

#include <memory>

#include "worker/integrators/erpt/settings.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_erpt_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
