// Kernel radii, and numbers of iterations and photons beyond 32 bits.
#include <cmath>

#include "tests/integrators.h"
#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

Sweep kernel_radius() {
  Sweep sweep;
  sweep.name = "kernel-radius";
  sweep.hazard = "radii tending to zero or covering the scene";
  sweep.parameter = "merging radius, in radii of the scene";
  // A ball cuts a disk of its own radius' area out of a sphere, however large, so that there is no bias.
  sweep.holds = "closed sphere, reflectance 0.5: 2";
  sweep.values = {1, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8};
  sweep.benign = 0.1;
  sweep.thin = {1, 0.1, 1e-4, 1e-8};
  sweep.shot = [](double value) {
    Shot shot = uniform_shot(closed_sphere(1, 0.5, 1), kSixteenEdges);
    set(shot, "radius", number(value));
    set(shot, "light_paths", "16");
    set(shot, "max_depth", number(16));
    return shot;
  };
  sweep.claims = claims_of(kMerging);
  for (const std::string& other : everyone_but(kMerging)) sweep.excuses.push_back({other, "has no radius"});
  return sweep;
}

Sweep iteration_index() {
  Sweep sweep;
  sweep.name = "iteration-index";
  sweep.hazard = "photon counts above 2^31";
  sweep.parameter = "index of the first iteration in its half, of 64 light paths each";
  sweep.holds = "closed sphere, reflectance 0.5: 2";
  sweep.values = {0, 0x1p16, 0x1p25, 0x1p31 - 8, 0x1p32 - 8, 0x1p36, 0x1p39};
  sweep.benign = 0;
  sweep.thin = {0, 0x1p31 - 8, 0x1p39};
  sweep.shot = [](double value) {
    Shot shot = uniform_shot(closed_sphere(1, 0.5, 1), kSixteenEdges);
    set(shot, "alpha", "0.9");  // after 2^40 iterations the radius is a quarter of the first
    shot.first = static_cast<std::uint64_t>(value);
    set(shot, "max_depth", number(16));
    return shot;
  };
  sweep.claims = claims_of(kOfIterations);
  for (const std::string& chains : test::chain_integrators())
    sweep.excuses.push_back({chains, "a chain's segments follow each other: none can be begun at"});
  return sweep;
}

}  // namespace

std::vector<Sweep> merging_sweeps() {
  return {kernel_radius(), iteration_index()};
}

}  // namespace candela::stress
