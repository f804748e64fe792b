// bdpt that mollifies paths which none of its techniques can sample: a form for all scenes, compiled by
// itself.
#pragma once

#include "worker/estimators/options.h"
#include "worker/integrators/bdpt/layers.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/regularise.h"

namespace candela::integrators::bdpt {

// Adds the samples of a unit.
using Run = Result<void> (*)(const UnitContext&, const estimators::PathOptions&,
                             const estimators::Techniques&, const TechniqueLayers&, const Regularization&,
                             const Unit&, film::UnitFilm&, const RunContext&);

Run mollified_run_for(transport::MisHeuristic heuristic);

}  // namespace candela::integrators::bdpt
