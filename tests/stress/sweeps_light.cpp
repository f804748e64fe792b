// Point, tiny and enormous lights, very dim and very bright ones, and light that is rarely found.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

constexpr double kPi = std::numbers::pi;

// The mean over [-h, h]^2 of the cosine over the squared distance to a point at height d, times d^2.
double falloff(double h, double d) {
  constexpr int kSteps = 400;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double x = h * (2 * (i + 0.5) / kSteps - 1), y = h * (2 * (j + 0.5) / kSteps - 1);
      const double squared = 1 + (x * x + y * y) / (d * d);
      sum += 1 / (squared * std::sqrt(squared));
    }
  return sum / (kSteps * kSteps);
}

Sweep light_radius() {
  Sweep sweep;
  sweep.name = "light-radius";
  sweep.hazard = "point, tiny and enormous lights";
  sweep.parameter =
      "radius of a spherical lamp over a plane two units (if larger: two radii) off; 0: a point";
  sweep.holds = "the irradiance of a ball: radiance pi (radius / distance)^2 cosine, which is kept the same";
  sweep.values = {0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10, 100, 1000};
  sweep.benign = 1;
  sweep.thin = {0, 1e-6, 1e-3, 1, 100};
  sweep.tolerance = 0.03;
  sweep.shot = [](double value) {
    Shot shot;
    const double distance = std::max(2.0, 2 * value);
    const double intensity = distance * distance;  // irradiance 1 below it
    shot.body =
        orthographic({0, 0, 0.5}, {0, 0, 0}, {0, 1, 0}, 0.4) + plate("<scale value=\"0.5\"/>", diffuse(0.5)) +
        (value == 0
             ? fmt::format(R"(<emitter type="point"><point name="position" value="{}"/>
                        <rgb name="intensity" value="{}"/></emitter>)",
                           triple({0, 0, distance}), intensity)
             : sphere({0, 0, distance}, value, diffuse(0) + area_light(intensity / (kPi * value * value))));
    shot.width = shot.height = 8;
    shot.settings = usual_settings();
    set(shot, "light_paths", "16");
    set(shot, "radius",
        number(0.05 / (0.75 * distance)));  // some 0.05 units, as the scene's is 0.75 distance
    shot.quantities = {{"image", 0, 0, 8, 8, 0.5 / kPi * falloff(0.4, distance), 1}};
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

Sweep radiance() {
  Sweep sweep;
  sweep.name = "radiance";
  sweep.hazard = "black scenes (b = 0); light near the ends of a float's range";
  sweep.parameter = "radiance emitted";
  sweep.holds = "closed sphere, reflectance 0.5: twice that; black without any light";
  sweep.values = {0, 1e-40, 1e-37, 1e-30, 1e-20, 1e-10, 1, 1e10, 1e20, 1e30, 1e37};
  sweep.benign = 1;
  sweep.thin = {0, 1e-37, 1e-30, 1e30};
  sweep.shot = [](double value) {
    Shot shot = uniform_shot(closed_sphere(1, 0.5, value), kSixteenEdges * value);
    set(shot, "max_depth", number(16));
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  add_adaptive(sweep);
  return sweep;
}

Sweep hidden_light() {
  Sweep sweep;
  sweep.name = "hidden-light";
  sweep.hazard = "chains stuck on one path";
  sweep.parameter = "share of the directions over a plane in which a lamp is found behind glass";
  sweep.holds = "index-matched glass vanishes: the irradiance of a ball, which is kept the same";
  sweep.values = {0.1, 1e-2, 1e-3, 1e-4, 1e-5};
  sweep.benign = 0.1;
  sweep.thin = {0.1, 1e-2, 1e-3};
  sweep.tolerance = 0.1;
  sweep.iterations = 32;
  sweep.shot = [](double value) {
    Shot shot;
    // Cosine-distributed directions meet a ball with probability (radius / distance)^2.
    const double distance = 2, radius = distance * std::sqrt(value);
    shot.body =
        orthographic({0, 0, 0.5}, {0, 0, 0}, {0, 1, 0}, 0.1) + plate("<scale value=\"0.5\"/>", diffuse(0.5)) +
        sphere({0, 0, distance}, radius, diffuse(0) + area_light(1 / value)) +
        sphere(
            {0, 0, distance}, 1.1 * radius,
            R"(<bsdf type="dielectric"><float name="int_ior" value="1"/><float name="ext_ior" value="1"/></bsdf>)");
    shot.width = shot.height = 8;
    shot.settings = usual_settings();
    set(shot, "over", "path");
    set(shot, "bootstrap", "100000");
    set(shot, "mutations", "4");
    set(shot, "light_paths", "16");
    shot.quantities = {{"image", 0, 0, 8, 8, 0.5 * falloff(0.1, distance), 1}};
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

}  // namespace

std::vector<Sweep> light_sweeps() {
  return {light_radius(), radiance(), hidden_light()};
}

}  // namespace candela::stress
