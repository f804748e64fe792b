// The proofs every bsdf goes through, from its XML on: parsed, built, prepared at a hit, then sampled and
// evaluated as the integrators do. Numbers are double and come from quadrature that knows its error, so that
// lobes down to roughness 0.01 are resolved without a chart of their own.
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::test {

// One bsdf to prove, and what its definition lets one expect of it.
struct BsdfConfiguration {
  std::string name;  // letters, digits and underscores; also seeds the streams
  std::string xml;   // one <bsdf> element

  // The index below the surface over that above, where all refraction has this one; 0: there are several, and
  // what depends on it is not asked.
  double eta = 1;
  // f(wo, wi) = f(wi, wo) for reflection, and across the boundary the same divided by the squared index of
  // the side it leaves to. Where its definition denies that, the reason. Each mode is the other's adjoint
  // always.
  std::string not_reciprocal = {};
  // Between these the fraction scattered lies for every wo with |cos| above 0.5 (least) and for all (most).
  double least_albedo = 0;
  double most_albedo = 1;
  bool unbounded_adjoint = false;  // the albedo in importance mode has no bound: shading normals
  std::string why_more = {};       // where most_albedo is above 1: why its definition makes light
  // Directions wo are these cosines on both sides; adds to the default ones.
  std::vector<double> more_cosines = {};
  // The geometric normal in the shading frame, unit. One that is not the z axis: with strict normals.
  Vec3 ng = {0, 0, 1};
};
void PrintTo(const BsdfConfiguration& configuration, std::ostream* out);

// Runs all proofs as gtest expectations. `alarm`: the false-alarm rate of each single statistical test.
// Returns how many statistical tests there were. Samples per test: 8000; where the environment has
// CANDELA_LONG=1, 200000, and the walk back is proved in both modes.
int prove_bsdf(const BsdfConfiguration& configuration, double alarm);

}  // namespace candela::test
