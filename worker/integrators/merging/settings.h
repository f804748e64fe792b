// Settings that all integrators of the merging family share.
#pragma once

#include "common/job/integrator_words.h"
#include "worker/integrators/merging/rules.h"
#include "worker/integrators/settings.h"

namespace candela::integrators::merging {

struct MergeSettings {
  double radius = 0;
  double radius_pixels = 0;
  int radius_neighbors = 0;
  double alpha;
  double light_paths = 1;
  Choice kernel{"constant", {"constant", "perlin", "epanechnikov"}};

  // Without the setting alpha the radius follows from statistics alone.
  explicit MergeSettings(const integrator_words::IntegratorWords& words)
      : alpha(words.alpha.text.empty() ? 1 : words.alpha.value) {}

  MergeRules rules() const {
    const transport::Kernel kind = kernel.value == "constant" ? transport::Kernel::constant
                                   : kernel.value == "perlin" ? transport::Kernel::perlin
                                                              : transport::Kernel::epanechnikov;
    return {kind, radius, radius_pixels, radius_neighbors, alpha, light_paths};
  }

  // progressive: the radius follows from the number of the iteration.
  template <class Visitor>
  void fields(Visitor& visit, bool progressive = true) {
    using integrator_words::kAlpha;
    visit(
        "radius", radius, NumberRange{0, 1},
        "merging radius of the first iteration, as a fraction of the radius of the scene's bounding sphere; "
        "0: the radius that holds ten photons of an iteration (median over the film), at most half a pixel "
        "(one if radii adapt, two without connections, ten in media without connections) or, if more, 0.003");
    visit("radius_pixels", radius_pixels, NumberRange{0, 1e6},
          "if > 0: first radius in pixel widths at the surfaces that the camera sees (median over the film); "
          "overrides radius");
    visit("radius_neighbors", radius_neighbors, 0, 1 << 14,
          "if > 0: choose the first radius so that it holds this many photons (median over the film); "
          "overrides radius and radius_pixels");
    if (progressive)
      visit(kAlpha.name, alpha, NumberRange{kAlpha.minimum, kAlpha.maximum, kAlpha.above_minimum},
            "how the radius shrinks: the variance of n iterations falls as n^-alpha, their bias as "
            "n^(alpha-1)");
    visit("light_paths", light_paths, NumberRange{0, 64, true}, "light paths of an iteration, per pixel");
    visit("kernel", kernel, "how the weight of a photon falls with its distance");
  }
};

// Merges of one eye path share it: they are no independent samples, which the power heuristic assumes.
template <class Visitor>
void no_heuristic(Visitor& visit) {
  visit.absent("heuristic", "merging is weighted by the balance heuristic alone",
               "leave it out; bdpt has heuristic=power");
}

}  // namespace candela::integrators::merging
