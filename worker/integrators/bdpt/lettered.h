// bdpt with layers by light path expressions, in scenes in which nothing lies between two vertices: compiled
// by itself. In other scenes the form for media reads the letters (docs/decisions/085).
#pragma once

#include "worker/integrators/bdpt/mollified.h"

namespace candela::integrators::bdpt {

Run lettered_run_for(transport::MisHeuristic heuristic);

}  // namespace candela::integrators::bdpt
