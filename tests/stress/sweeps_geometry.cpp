// Size and place of the scene, its extent, and the film's.
#include <fmt/format.h>

#include <cmath>

#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

// A floor, a matt ball, a glass one, one of fog, a lamp and a sky, `s` times as large and moved by `offset`.
std::string still_life(double s, const Vec& offset) {
  const auto at = [&](double x, double y, double z) {
    return Vec{s * x + offset[0], s * y + offset[1], s * z + offset[2]};
  };
  const auto placed = [&](const std::string& turn, double size, const Vec& where) {
    return fmt::format(R"({}<scale value="{}"/><translate value="{}"/>)", turn, s * size, triple(where));
  };
  return perspective(at(0, 1, 4), at(0, 0.6, 0), {0, 1, 0}, 35, s) + constant_sky(0.2) +
         plate(placed(R"(<rotate x="1" angle="-90"/>)", 2, at(0, 0, 0)), diffuse(0.6)) +
         plate(placed(R"(<rotate x="1" angle="90"/>)", 0.6, at(0, 2.5, 0)), diffuse(0) + area_light(6)) +
         sphere(at(-0.6, 0.45, 0), s * 0.4, diffuse(0.7)) +
         sphere(at(0.5, 0.4, 0.4), s * 0.35, "<bsdf type=\"dielectric\"/>") +
         sphere(at(0.1, 1.1, -0.5), s * 0.4, null_block(2 / s, 0.8));
}

Shot still_life_shot(double s, const Vec& offset) {
  Shot shot;
  shot.body = still_life(s, offset);
  shot.settings = usual_settings();
  set(shot, "max_depth", number(6));
  return shot;
}

Sweep scale() {
  Sweep sweep;
  sweep.name = "scale";
  sweep.hazard = "scenes scaled by 1e-6 to 1e6";
  sweep.parameter = "scale of the scene";
  sweep.holds = "the image does not change";
  sweep.values = {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10, 100, 1e3, 1e4, 1e5, 1e6};
  sweep.benign = 1;
  sweep.thin = {1e-6, 1e-3, 1e3, 1e6};
  sweep.shot = [](double value) { return still_life_shot(value, {0, 0, 0}); };
  sweep.claims = claims_of(kEveryone);
  add_adaptive(sweep);
  return sweep;
}

Sweep offset() {
  Sweep sweep;
  sweep.name = "offset";
  sweep.hazard = "scenes far from the origin";
  sweep.parameter = "distance from the origin, of a scene 4 units wide";
  sweep.holds = "the image does not change";
  sweep.values = {0, 1, 10, 100, 1e3, 3e3, 1e4, 3e4, 1e5, 1e6, 1e7, 1e9};
  sweep.benign = 0;
  sweep.thin = {10, 1e5, 1e9};
  sweep.shot = [](double value) { return still_life_shot(1, {0.8 * value, 0.36 * value, -0.48 * value}); };
  sweep.claims = claims_of(kEveryone);
  add_path_states(sweep);
  add_adaptive(sweep);
  for (Claim& claim : sweep.claims)
    if (claim.integrator == "mmlt") claim.iterations = 2 * sweep.iterations;  // else some seeds say nothing
  return sweep;
}

Sweep extent() {
  Sweep sweep;
  sweep.name = "extent";
  sweep.hazard = "small things in large scenes; kernel radii over eight decades of the scene's size";
  sweep.parameter = "distance of a black speck, in radii of a closed sphere";
  sweep.holds = "closed sphere, reflectance 0.5: 2; merging within 0.1 of its radius";
  sweep.values = {1.5, 10, 100, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8};
  sweep.benign = 1.5;
  sweep.thin = {1.5, 1e4, 1e8};
  sweep.shot = [](double value) {
    Shot shot = uniform_shot(closed_sphere(1, 0.5, 1) + sphere({value, 0, 0}, 0.01 * value, diffuse(0)),
                             kSixteenEdges);
    set(shot, "radius", number(0.2 / (1 + 1.01 * value)));
    set(shot, "max_depth", number(16));
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

Sweep film_size() {
  Sweep sweep;
  sweep.name = "film-size";
  sweep.hazard = "one-pixel and huge films";
  sweep.parameter = "pixels across, and at most 16 the other way; negative: down";
  sweep.holds = "closed sphere, reflectance 0.5: 2";
  sweep.values = {-16384, -1024, -16, 1, 2, 16, 1024, 16384, 65536};
  sweep.benign = 1;
  sweep.thin = {-1024, 1, 16, 1024};
  sweep.iterations = 1;
  sweep.shot = [](double value) {
    Shot shot;
    shot.body = closed_sphere(1, 0.5, 1);
    const auto size = static_cast<std::uint32_t>(std::fabs(value));
    shot.width = value > 0 ? size : std::min(size, 16U);
    shot.height = value > 0 ? std::min(size, 16U) : size;
    shot.settings = usual_settings();
    if (size > 16) set(shot, "mutations", number(1));
    shot.quantities = uniform_quantities(shot.width, shot.height, kSixteenEdges);
    set(shot, "max_depth", number(16));
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

}  // namespace

std::vector<Sweep> geometry_sweeps() {
  return {scale(), offset(), extent(), film_size()};
}

}  // namespace candela::stress
