// What optimis does with a scene.
#pragma once

#include "worker/estimators/first_vertex.h"
#include "worker/integrators/optimis/settings.h"
#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::optimis {

// How the weights of the image come about.
enum class ReadOut : std::uint8_t {
  film,    // the film is the image: a heuristic of densities
  sums,    // optimal weights from the sums of the job
  epochs,  // progressive: optimal weights from the sums of the epochs before
  fan,     // optimal weights of each iteration by itself
  best,    // the technique of least variance
};

struct PlannedFirstVertex {
  Planned planned;
  estimators::FirstVertexSetup setup;  // without techniques: the path tracer's own
  ReadOut read_out = ReadOut::film;
  mis::Eligible eligible = 0;  // of best
  std::uint32_t lights = 0;    // or groups of lights, whose visibility is learned; 0: none
};

// Fails (usage) if weights=best finds no technique that reaches all lights.
Result<PlannedFirstVertex> plan(const OptimisSettings& settings, const estimators::PathOptions& options,
                                const scene::SceneFeatures& features);

}  // namespace candela::integrators::optimis
