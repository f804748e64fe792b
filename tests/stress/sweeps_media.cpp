// Optically thick and almost empty media.
#include <fmt/format.h>

#include <cmath>

#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

std::string block(double thickness, double albedo) {
  return fmt::format("<shape type=\"cube\">{}</shape>", null_block(thickness / 2, albedo));
}

Sweep scattering_block() {
  Sweep sweep;
  sweep.name = "scattering-block";
  sweep.hazard = "optically thick and almost empty media";
  sweep.parameter = "optical thickness of a block that absorbs nothing";
  sweep.holds = "it vanishes under a constant sky";
  sweep.values = {1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10, 100, 1e3, 1e4, 1e5};
  sweep.benign = 1;
  sweep.thin = {1e-5, 1, 10};
  sweep.tolerance = 0.03;
  sweep.shot = [](double value) {
    return uniform_shot(perspective({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 15) + constant_sky(1) + block(value, 1),
                        1);
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

Sweep absorbing_block() {
  Sweep sweep;
  sweep.name = "absorbing-block";
  sweep.hazard = "optically thick and almost empty media";
  sweep.parameter = "optical thickness of a block that scatters nothing";
  sweep.holds = "the sky behind it is dimmed by exp(-thickness), to 1e-6 of the sky";
  sweep.values = {1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10, 100, 1e3, 1e4, 1e5};
  sweep.benign = 1;
  sweep.thin = {1e-5, 1, 10, 1e5};
  sweep.floor = 1e-6;
  sweep.shot = [](double value) {
    return uniform_shot(
        orthographic({0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 0.5) + constant_sky(1) + block(value, 0),
        std::exp(-value));
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

}  // namespace

std::vector<Sweep> media_sweeps() {
  return {scattering_block(), absorbing_block()};
}

}  // namespace candela::stress
