// Options of the iterations of the merging family.
#pragma once

#include <string>
#include <vector>

#include "worker/estimators/options.h"
#include "worker/integrators/merging/rules.h"

namespace candela::integrators::merging {

// Options of an integrator of the family, the same for all iterations.
struct IterationOptions {
  estimators::PathOptions paths;
  estimators::Techniques techniques;
  MergeRules merge;
  bool caustics_only = false;     // see LightKeeping
  bool merging_layer = false;     // the part of the image that merging brings is a layer of the film
  bool technique_layers = false;  // estimators::kTechniqueLayers are its layers

  std::vector<std::string> layers() const {
    if (technique_layers) return {estimators::kTechniqueLayers.begin(), estimators::kTechniqueLayers.end()};
    return merging_layer ? std::vector<std::string>{"merging"} : std::vector<std::string>();
  }
};

}  // namespace candela::integrators::merging
