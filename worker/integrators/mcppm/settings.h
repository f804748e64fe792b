#pragma once

#include "common/stages/photon_chains.h"
#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct McppmSettings {
  CommonSettings common{integrator_words::kMcppm};
  merging::MergeSettings merge{integrator_words::kMcppm};
  Choice photons{"all", {"all", "caustics"}};
  double mutations_per_path = 1;
  Choice split{"setting", {"setting", "pilot"}};
  double step = 1.0 / 64;
  adaptive::EpochSettings epochs;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    visit("photons", photons,
          "caustics: stores and shows only light that comes to a vertex from a specular vertex");
    visit("mutations_per_path", mutations_per_path, NumberRange{0, 1024},
          "mutations of an iteration, per light path; 0: no chains, as ppm");
    visit("split", split,
          "pilot: splits the sum of light paths and mutations anew, by the visible fraction that it finds");
    visit(
        "step", step, NumberRange{photon_chains::kMinStep, photon_chains::kMaxStep},
        "largest distance by which a mutation moves a random number, until an epoch's acceptance decides it");
    epochs.fields(visit,
                  "iterations of the shortest epoch, an even number: the step is decided once an epoch");
  }
};

}  // namespace candela::integrators
