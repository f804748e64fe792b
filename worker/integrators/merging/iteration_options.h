// Options of the iterations of the merging family.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "worker/estimators/options.h"
#include "worker/integrators/merging/rules.h"

namespace candela::integrators::merging {

// The merging radius of the first iteration, in scene units, and how it was chosen.
struct ChosenRadius {
  double value = 1;
  std::string why = {};
};

// Of a renderer, which is the same for all units.
struct ChosenOnce {
  std::once_flag once;
  ChosenRadius radius;
};

// Options of an integrator of the family, the same for all iterations.
struct IterationOptions {
  estimators::PathOptions paths;
  estimators::Techniques techniques;
  MergeRules merge;
  bool caustics_only = false;     // see LightKeeping
  bool merging_layer = false;     // the part of the image that merging brings is a layer of the film
  bool technique_layers = false;  // estimators::kTechniqueLayers are its layers
  // Options that differ in their techniques alone may share it.
  std::shared_ptr<ChosenOnce> chosen = std::make_shared<ChosenOnce>();

  std::vector<std::string> layers() const {
    if (technique_layers) return {estimators::kTechniqueLayers.begin(), estimators::kTechniqueLayers.end()};
    return merging_layer ? std::vector<std::string>{"merging"} : std::vector<std::string>();
  }
};

}  // namespace candela::integrators::merging
