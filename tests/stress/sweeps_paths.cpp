// Long paths, and paths that carry next to nothing.
#include <cmath>

#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

Sweep path_length() {
  Sweep sweep;
  sweep.name = "path-length";
  sweep.hazard = "products of pdfs on long paths; paths of a thousand vertices";
  sweep.parameter = "most edges of a path";
  sweep.holds = "closed sphere, reflectance 0.999, no roulette: the geometric sum";
  sweep.values = {1, 2, 4, 8, 16, 64, 250, 1000};
  sweep.benign = 2;
  sweep.thin = {1, 4, 64, 1000};
  sweep.tolerance = 0.03;
  sweep.iterations = 4;
  sweep.shot = [](double value) {
    Shot shot;
    shot.body = closed_sphere(1, 0.999, 1);
    shot.width = shot.height = 2;
    shot.settings = usual_settings();
    set(shot, "max_depth", number(value));
    set(shot, "rr_depth", "1000000");
    set(shot, "over", "path");  // a sample over bdpt has half a million connections
    shot.quantities = {{"image", 0, 0, 2, 2, (1 - std::pow(0.999, value)) / (1 - 0.999), 1}};
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  add_path_states(sweep);
  for (Claim& claim : sweep.claims)
    if (claim.integrator == "bdpt" || claim.integrator == "vcm") claim.iterations = 1;
  return sweep;
}

Sweep bright_walls() {
  Sweep sweep;
  sweep.name = "bright-walls";
  sweep.hazard = "Russian roulette where nothing is lost; paths without a limit";
  sweep.parameter = "reflectance";
  sweep.holds = "closed sphere, default roulette, no limit: 1 / (1 - reflectance)";
  sweep.values = {0.5, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99};
  sweep.benign = 0.5;
  sweep.thin = {0.5, 0.9, 0.95, 0.98};
  sweep.tolerance = 0.03;
  sweep.shot = [](double value) {
    Shot shot = uniform_shot(closed_sphere(1, value, 1), 1 / (1 - value));
    set(shot, "over", "path");  // a sample over bdpt has thousands of connections
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

Sweep zero_throughput() {
  Sweep sweep;
  sweep.name = "zero-throughput";
  sweep.hazard = "Russian roulette at zero throughput";
  sweep.parameter = "reflectance of two channels, the third being black";
  sweep.holds = "closed sphere, roulette from the first edge: 1 / (1 - reflectance) of each channel";
  sweep.values = {0.5, 0.1, 1e-3, 1e-10, 1e-20, 1e-30, 1e-38, 1e-42, 0};
  sweep.benign = 0.5;
  sweep.thin = {0.5, 1e-10, 1e-38, 1e-42, 0};
  sweep.shot = [](double value) {
    Shot shot =
        uniform_shot(perspective({0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 60) +
                         sphere({0, 0, 0}, 1,
                                "<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"" + number(value) +
                                    ", 0, " + number(value) + "\"/></bsdf>" + area_light(1),
                                true),
                     (1 + 2 / (1 - value)) / 3);
    set(shot, "rr_depth", "1");
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  add_path_states(sweep);
  add_adaptive(sweep);
  return sweep;
}

}  // namespace

std::vector<Sweep> path_sweeps() {
  return {path_length(), bright_walls(), zero_throughput()};
}

}  // namespace candela::stress
