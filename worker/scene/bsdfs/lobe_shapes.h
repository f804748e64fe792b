// Widths of the lobes of a closure, and how they bend light. Mutations of half vectors need both for their
// steps.
#pragma once

#include <vector>

#include "worker/scene/bsdf.h"

namespace candela::scene {

struct LobeShape {
  bool transmitted = false;
  // Roughness of facets, the smaller one of an anisotropic lobe; 0: a delta lobe; 1: a diffuse lobe.
  double alpha = 1;
  // For transmission: the index beyond the surface over that on wo's side. 1: light is not bent.
  double eta = 1;
};

// The lobes of the closure that was prepared for wo; of lobes under a layer and in turned frames, as if they
// were seen without these. What passes straight on is no lobe.
std::vector<LobeShape> lobe_shapes(const Closure& closure, Vec3 wo);

}  // namespace candela::scene
